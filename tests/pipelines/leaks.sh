#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Nothing of GStreamer's is left behind when a pipeline is gone.
set -eu
log=$(mktemp)
trap 'rm -f "$log"' EXIT
export GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1 GST_DEBUG_FILE=$log

check() {
  echo "gst-launch-1.0 $*"
  timeout 60 "$GST_LAUNCH" -q "$@" || true
  if grep "object-alive, " "$log" | grep -v "new format string"; then
    echo "FAILED: these were leaked"
    exit 1
  fi
  grep -q "GST_TRACER" "$log" # the tracer was there
}

for element in frame dense sparse diff; do
  check videotestsrc num-buffers=8 ! eventsim-$element ! fakesink
  check videotestsrc num-buffers=8 ! eventsim-$element ! videoconvert ! fakesink
done
# Errors half-way.
check videotestsrc num-buffers=8 ! eventsim-frame ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! identity error-after=2 ! fakesink
check videotestsrc num-buffers=8 ! identity error-after=4 ! eventsim-dense ! fakesink
