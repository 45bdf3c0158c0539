#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the examples of pipelines/; those for the same pipeline count the same events.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
line="videotestsrc pattern=ball num-buffers=40 ! eventsim-diff ! appsink name=events sync=false"

"$BUILD/pipelines/count_events" "$line" | tee "$work/c"
counted=$(sed -n 's/^Total *\([0-9]*\) events.*/\1/p' "$work/c")
[ "$counted" -gt 10000 ]

if "$BUILD/pipelines/count_events" "filesrc location=/nowhere ! decodebin ! eventsim-diff ! appsink name=events"; then
  echo "FAILED: a missing file was read"
  exit 1
fi

if [ ! -f "$GI_TYPELIB_PATH/GstEventCamera-1.0.typelib" ]; then
  echo "built without introspection: Python example skipped"
  exit 77
fi
"$SOURCE/pipelines/events_to_numpy.py" "$line" "$work/events.npy" | tee "$work/python"
grep -q "^$counted events" "$work/python"
/usr/bin/python3 - "$work/events.npy" <<'PYTHON'
import sys
import numpy as np
events = np.load(sys.argv[1])
assert (np.diff(events["t"]) >= 0).all(), "not sorted"
assert events["x"].max() < 320 and events["y"].max() < 240, "beyond the sensor"
assert 0.3 < events["p"].mean() < 0.7, "polarities are unequal"
PYTHON

# The same example in three languages.
"$BUILD/pipelines/on_and_off" | tee "$work/expected"
grep -qx "Events of a 320x240 sensor" "$work/expected"
grep -qx "[1-9][0-9]* ON, [1-9][0-9]* OFF" "$work/expected"
for language in py js; do
  "$SOURCE/pipelines/examples/on_and_off.$language" | diff "$work/expected" -
done
