#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the examples of pipelines/; those for the same pipeline count the same events.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
line="videotestsrc pattern=ball num-buffers=40 ! video/x-raw,format=GRAY8 ! eventsim-dvs ! appsink name=events sync=false"

"$BUILD/pipelines/count_events" "$line" | tee "$work/c"
counted=$(sed -n 's/^Total *\([0-9]*\) events.*/\1/p' "$work/c")
[ "$counted" -gt 10000 ]

# Errors say what is wrong, and what to write instead.
refused() { # WORDS COMMAND...
  local words=$1
  shift
  echo "$*"
  if timeout 60 "$@" >/dev/null 2>"$work/errors"; then
    echo "FAILED: it succeeded"
    exit 1
  fi
  cat "$work/errors"
  grep -q -e "$words" "$work/errors"
  if grep -e Traceback -e CRITICAL "$work/errors"; then exit 1; fi
}
counter=$BUILD/pipelines/count_events
refused "receives video/x-raw, not events..*! eventsim-dvs ! appsink name=events" "$counter" "videotestsrc num-buffers=3 ! appsink name=events"
refused "end it in: ! appsink name=events" "$counter" "fakesink name=events"
refused 'no element "eventdim"' "$counter" "videotestsrc ! eventdim ! appsink name=events"
refused 'No such file "/nowhere"' "$counter" "filesrc location=/nowhere ! decodebin ! appsink name=events"

if [ ! -f "$GI_TYPELIB_PATH/GstEventCamera-1.0.typelib" ]; then
  echo "built without introspection: Python example skipped"
  exit 77
fi
events_to_numpy=$SOURCE/pipelines/examples/events_to_numpy.py
"$events_to_numpy" "${line% ! appsink*}" "$work/events.npy" | tee "$work/python"
grep -q "^$counted events of a 320x240 sensor" "$work/python"
refused "can't handle caps application/x-event-camera" "$events_to_numpy" "videotestsrc num-buffers=3" "$work/none.npy"
/usr/bin/python3 - "$work/events.npy" <<'PYTHON'
import sys
import numpy as np
events = np.load(sys.argv[1])
assert (np.diff(events["t"]) >= 0).all(), "not sorted"
assert events["x"].max() < 320 and events["y"].max() < 240, "beyond the sensor"
assert 0.3 < events["p"].mean() < 0.7, "polarities are unequal"
PYTHON

# PyTorch's workers read recordings and make voxel grids; the loss decreases.
for name in first second; do
  "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=30 ! video/x-raw,width=64,height=48,framerate=30/1 ! \
    eventsim-dvs ! application/x-event-camera ! evtenc ! filesink location="$work/$name.raw"
done
"$SOURCE/pipelines/examples/train_on_events.py" "$work/first.raw" "$work/second.raw" | tee "$work/training"
awk '$1 == "epoch" { if (NR > 1 && ($6 + 0 >= last || $3 < 60)) exit 1; last = $6 } END { exit NR != 3 }' "$work/training"

# The same example in three languages.
"$BUILD/pipelines/on_and_off" | tee "$work/expected"
grep -qx "Events of a 320x240 sensor" "$work/expected"
grep -qx "[1-9][0-9]* ON, [1-9][0-9]* OFF" "$work/expected"
for language in py js; do
  "$SOURCE/pipelines/examples/on_and_off.$language" | diff "$work/expected" -
done
# Without its simulator; in C, built with the pkg-config file of the build directory.
for language in py js c; do
  sed 's/eventsim-dvs ! appsink name/appsink name/' "$SOURCE/pipelines/examples/on_and_off.$language" >"$work/video.$language"
done
export PKG_CONFIG_PATH=$BUILD/meson-uninstalled
eval "flags=($(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0))" # escapes spaces
cc -o "$work/on_and_off" "$SOURCE/pipelines/examples/on_and_off.c" "${flags[@]}"
"$work/on_and_off" | diff "$work/expected" -
cc -o "$work/video" "$work/video.c" "${flags[@]}"
refused "receives no events; insert a simulator" "$work/video"
refused "receives no events; insert a simulator" /usr/bin/python3 "$work/video.py"
refused "receives no events; insert a simulator" gjs -m "$work/video.js"
