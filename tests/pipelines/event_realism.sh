#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# event-realism tells a second recording of a scene from the events of another simulator.
set -euo pipefail
source "$SOURCE/tests/pipelines/scratch_folder.sh"
if [ ! -f "$GI_TYPELIB_PATH/GstEventCamera-1.0.typelib" ]; then
  echo "built without introspection: no Python"
  exit 77
fi

"$GST_LAUNCH" -q videotestsrc pattern=zone-plate kx2=12 ky2=12 kt=5 num-buffers=16 ! video/x-raw,format=I420,width=161,height=90,framerate=25/1 ! matroskamux ! filesink location=scene.mkv
simulate() { # FILE ENCODER ELEMENT...
  local file=$1 encoder=$2
  shift 2
  "$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! "$@" ! "$encoder" ! filesink location="$file"
}
for seed in 1 2; do simulate real$seed.raw evtenc eventsim-dvs shot-noise-rate=5 seed=$seed; done
simulate dense.csv eventcsvenc eventsim-dense positive-threshold=5

realism() {
  echo "event-realism $*"
  timeout 60 "$BUILD/pipelines/event-realism" "$@" 2>errors
}
realism real1.raw real1.raw real2.raw dense.csv --html page.html >table
cat table
column() { # NUMBER TITLE: the cell of a row, with its mark
  sed -n "s/^$2  *//p" table | sed 's/ \*/*/g; s/ (/(/g; s/ ±/±/; s/ %/%/g' | awk -v column="$1" '{ print $column }'
}
[ "$(column 2 "map correlation")" = 1.000 ] || fail "a recording is unlike itself"
[ "$(column 2 "similarity of reconstructions")" = 1.000 ] || fail "a reconstruction is unlike itself"
awk -v second="$(column 3 "similarity of reconstructions")" -v dense="$(column 4 "similarity of reconstructions")" \
  'BEGIN { exit !(second > 0.5 && dense < second - 0.1) }' || fail "reconstructions of dense interpolation are as similar"
[ "$(column 2 "real events matched within 1 ms")" = 1.000 ] || fail "a recording does not match itself"
[ "$(column 2 "nearest match of real events, ms")" = 0.00 ] || fail "a recording is far from itself"
[ "$(grep -c '^[a-z].* \*$' table)" -ge 10 ] || fail "dense interpolation is within the noise ceiling"
grep -qF "<th>map correlation</th>" page.html || fail "the page has no map correlation"
for title in "standard deviation" "rate correlation, 1 ms" "interval distance, decades" \
  "real events matched within 10 ms" "simulated events matched within 10 ms"; do
  [[ $(column 3 "$title") != *\** ]] || fail "$title of a second recording is beyond the noise ceiling"
  [[ $(column 4 "$title") == *\* ]] || fail "$title of dense interpolation is within the noise ceiling"
  grep -qF "<th>$title</th>" page.html || fail "the page has no $title"
done

# The page needs no network.
! grep -oE '(src|href)="(http|//)[^"]*' page.html || fail "the page refers to the network"
[ "$(grep -o 'src="data:image/png;base64,[A-Za-z0-9+/]*' page.html | wc -l)" -eq 4 ] || fail "maps are missing"
[ "$(grep -o '<svg' page.html | wc -l)" -eq 3 ] || fail "curves are missing"
realism real1.raw real2.raw --video scene.mkv --from 0.1 --to 0.4 --html page.html >table
grep -q "change of the logarithm of the light" page.html || fail "the page has no response to the light"

# Times from 0 on: no event is left out, and all figures are those of later times.
"$BUILD/pipelines/event-convert" real1.raw real1.csv
for start in 0 1000; do
  awk -F, -v OFS=, -v start=$start 'NR == 2 { shift = start - $1 } NR > 1 { $1 += shift } { print }' real1.csv >from.csv
  "$BUILD/pipelines/event-convert" --width=161 --height=90 from.csv from.raw
  realism from.raw from.raw >from$start.table
done
cmp from0.table from1000.table || fail "a comparison from the time 0 on is another"
PYTHONPATH=$BUILD/pipelines:$PYTHONPATH /usr/bin/python3 - <<'PYTHON' || fail "not all events are compared"
import numpy as np
from event_streams import Sensor, Span, compare

events = np.array([(0, 1, 1, True), (5, 2, 1, False), (9, 3, 2, True)], "i8,u2,u2,?")
events.dtype.names = "txyp"
assert compare(Sensor(4, 4), events, events, Span(-1, 9))["reference"]["events"] == 3
# 90 minutes, more than the times of one buffer.
long = np.zeros(5400, events.dtype)
long["t"] = np.arange(5400) * 1_000_000
figures = compare(Sensor(4, 4), long, long, Span(-1, 5_399_000_000))
assert figures["reference"]["events"] == 5400, figures
assert abs(figures["reference"]["rate"] - 1) < 0.01, figures
PYTHON

# Events outside a mask do not count.
printf 'P5 161 90 255\n' >none.pgm
head -c $((161 * 90)) /dev/zero >>none.pgm
"$GST_LAUNCH" -q filesrc location=none.pgm ! decodebin ! videoconvert ! pngenc ! filesink location=none.png
"$GST_LAUNCH" -q videotestsrc num-buffers=4 ! video/x-raw,width=320,height=240 ! eventsim-dvs shot-noise-rate=100 ! evtenc ! filesink location=large.raw
head -c 100 real1.raw >empty.raw
refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  if realism "$@" >table; then fail "it succeeded"; fi
  cat table errors
  grep -q "$words" errors || fail "the error does not say \"$words\""
  ! grep -q Traceback errors || fail "the error is a traceback"
  ! grep -q "map correlation" table || fail "the error comes after the comparison"
}
refused "none.png\|no events where the mask is white" real1.raw real2.raw --mask none.png
refused "large.raw: it has 320 x 240 pixels, more than" real1.raw large.raw
refused "empty.raw: no events" real1.raw empty.raw
refused "name one with --html" real1.raw real2.raw --video scene.mkv
"$GST_LAUNCH" -q videotestsrc num-buffers=4 ! video/x-raw,width=320,height=240 ! matroskamux ! filesink location=large.mkv
refused "large.mkv has 320 x 240 pixels, the recording has 161 x 90" real1.raw real2.raw --video large.mkv --html page.html
refused "scene.mkv has fewer than two frames" real1.raw real2.raw --video scene.mkv --html page.html --to 0.03

# Ctrl-C ends the programs quietly. They leave no compiled files.
cat >sitecustomize.py <<'PYTHON'
import argparse


def interrupt(*_):
    raise KeyboardInterrupt


argparse.ArgumentParser.parse_args = interrupt
PYTHON
for program in event-calibrate event-realism; do
  code=0
  PYTHONPATH=$PWD:$PYTHONPATH PYTHONDONTWRITEBYTECODE= PYTHONPYCACHEPREFIX=$PWD/compiled \
    "$BUILD/pipelines/$program" 2>errors || code=$?
  [ $code -eq 130 ] && [ ! -s errors ] || fail "$program: status $code: $(cat errors)"
  [ ! -e compiled ] || fail "$program leaves compiled files"
done
