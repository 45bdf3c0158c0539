#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Lines that a user would type, with gst-launch-1.0 itself.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

launch() {
  echo "gst-launch-1.0 $*"
  timeout 60 "$GST_LAUNCH" -q "$@"
}

fail() {
  echo "FAILED: $*"
  exit 1
}

# Events of every simulator into a file.
for element in frame dense sparse diff; do
  launch videotestsrc pattern=ball num-buffers=30 ! eventsim-$element ! application/x-event-camera ! filesink location=ball-$element.xytp
  size=$(stat -c %s ball-$element.xytp)
  [ "$size" -gt 8000 ] && [ $((size % 8)) -eq 0 ] || fail "$element: $size bytes"
done

# Accumulated events as video, to an encoder and back.
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! videoconvert ! x264enc ! mp4mux ! filesink location=events.mp4
launch filesrc location=events.mp4 ! decodebin ! eventsim-dense flow=dis-hq ! videoconvert ! fakesink
[ -s events.mp4 ] || fail "no video was written"

# No converter in front: what cameras and decoders give.
for format in YUY2 UYVY NV12 I420 GRAY8 P010_10LE; do
  launch videotestsrc num-buffers=5 ! video/x-raw,format=$format ! eventsim-frame positive-threshold=15 ! fakesink
done
launch videotestsrc num-buffers=5 ! jpegenc ! jpegdec ! eventsim-frame ! fakesink

# A tee, live sources, sinks with a clock, threads.
launch videotestsrc is-live=true num-buffers=20 ! tee name=t  t. ! queue ! eventsim-frame ! fakesink sync=true  t. ! queue ! eventsim-sparse ! videoconvert ! fakesink sync=true

# Upstreams without allocation queries, with videorate's copies, and with one frame only.
launch videotestsrc num-buffers=10 ! identity drop-allocation=true ! eventsim-dense ! fakesink
launch videotestsrc num-buffers=10 ! videorate ! video/x-raw,framerate=50/1 ! eventsim-diff ! fakesink
launch videotestsrc num-buffers=1 ! eventsim-sparse ! fakesink

# Mixed back into a picture.
launch videotestsrc pattern=ball num-buffers=20 ! tee name=t  t. ! queue ! mixer.  t. ! queue ! eventsim-diff ! videoconvert ! mixer.  compositor name=mixer sink_1::alpha=0.5 ! fakesink

# Interrupted with -e, it ends in order.
echo "gst-launch-1.0 -e, interrupted"
timeout 60 "$GST_LAUNCH" -q -e videotestsrc is-live=true ! eventsim-frame ! videoconvert ! x264enc tune=zerolatency ! mp4mux ! filesink buffer-mode=unbuffered location=interrupted.mp4 &
launched=$!
for _ in $(seq 300); do
  [ "$(stat -c %s interrupted.mp4 2>/dev/null || echo 0)" -gt 10000 ] && break
  sleep 0.1
done
pkill -INT -P $launched
wait $launched || true
launch filesrc location=interrupted.mp4 ! decodebin ! fakesink

# Refused, with a reason.
if "$GST_LAUNCH" -q videotestsrc num-buffers=2 ! video/x-raw,format=RGB ! eventsim-frame ! fakesink 2>refusal; then
  fail "RGB was taken"
fi
grep -q "format=(string)RGB" refusal || fail "the refusal does not name the format"
echo "all lines ran"
