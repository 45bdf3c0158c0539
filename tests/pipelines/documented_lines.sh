#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the command lines of README.md and docs/.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"
source "$SOURCE/tests/pipelines/run_lines.sh"
export PATH=$BUILD/pipelines:$PATH
mkdir pipelines
cp -r "$SOURCE/pipelines/examples" pipelines/

# The files that the lines read.
eval "$GST_LAUNCH -q $ball ! x264enc ! mp4mux ! filesink location=drive.mp4"
eval "$GST_LAUNCH -q filesrc location=drive.mp4 ! decodebin ! eventsim-dvs ! evtenc ! filesink location=drive.raw"
eval "$GST_LAUNCH -q videotestsrc pattern=ball num-buffers=40 ! video/x-raw,format=GRAY8,framerate=25/1 ! tee name=t  t. ! queue ! eventsim-dvs ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux ! filesink location=davis.aedat4"
eval "$GST_LAUNCH -q filesrc location=drive.raw ! evtdec ! eventcsvenc format=esim ! filesink location=events.txt"
for name in in recording real simulated left right a b hd; do cp drive.raw $name.raw; done
# A mask that leaves out the left half, and a calibration.
"$GST_LAUNCH" -q videotestsrc pattern=white num-buffers=1 ! video/x-raw,width=160,height=240 ! \
  videobox left=-160 ! video/x-raw,format=GRAY8 ! pngenc ! filesink location=mask.png
cat >camera.yaml <<CALIBRATION
%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 300., 0., 160., 0., 300., 120., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0., 0., 0. ]
CALIBRATION
/usr/bin/python3 "$SOURCE/tests/formats/bag_files.py" .
for ending in bag mcap; do mv evt3.$ending walk.$ending; done
/usr/bin/python3 "$SOURCE/tests/formats/n_mnist.py" .
mv n-mnist.bin 00002.bin
for words in EVT2 EVT3; do
  eval "$GST_LAUNCH -q $ball,width=320,height=320 ! eventsim-dvs ! evtenc ! application/x-event-camera,format=$words ! filesink location=camera.${words,,}"
done
{
  cat camera.evt3
  printf '\x19\xe0'
} >camera.grey
truncate -s $((4096 * 391)) camera.grey
mkdir videos recordings arrays pictures
eval "$GST_LAUNCH -q $ball ! videoconvert ! pngenc snapshot=false ! multifilesink location=pictures/%d.png"
cp drive.mp4 videos/first.mp4
cp drive.mp4 "videos/second one.mp4"
cp drive.raw recordings/first.raw
cp drive.raw "recordings/second one.raw"
for ending in dat es csv; do event-convert drive.raw recording.$ending; done
/usr/bin/python3 -c 'import numpy; numpy.savez("events.npz", **{name: numpy.zeros(9, int) for name in "txyp"})'

# The first recipe of the page.
sed -n '/^```yaml$/,/^```$/p' "$SOURCE/docs/data-sets.md" | sed '1d; /^```$/q' | sed '/^```/d' >recipe.yaml
run_lines "$SOURCE/README.md" "$SOURCE"/docs/*.md "$SOURCE"/docs/elements/*.md
for page in README.md docs/learning.md docs/data-sets.md docs/recipes.md docs/latency.md; do
  sed -n '/^```python$/,/^```$/p' "$SOURCE/$page" | sed '/^```/d; s/v4l2src/videotestsrc is-live=true pattern=ball/' >block.py
  echo "Python of $page"
  timeout 120 /usr/bin/python3 block.py >output 2>&1 || fail "$(cat output)"
done
[ $count -ge 60 ] || fail "found only $count lines"
for file in events.webm events.mp4 ball.npz recording.h5 figures.json map.png maps.png out.raw events.npy received.raw \
  webcam.npz "videos/second one.h5" filtered.raw cropped.raw beside.raw quarter.raw turned.raw flat.raw both.raw both.webm rate.png part.raw "arrays/second one.npz" \
  phone.raw pictures.raw talk.mp4 talk.gif sheet.png over.mp4 joined.raw backwards.raw drive.h5 \
  recipe/manifest.json "recipe/data/second one.npy"; do
  [ -s "$file" ] || fail "$file is missing or empty"
done
gst-discoverer-1.0 -v events.mp4 | grep -q "profile=(string)main.*chroma-format=(string)4:2:0" ||
  fail "players cannot play $(gst-discoverer-1.0 -v events.mp4 | grep profile=)"
# 40 frames of a video of 25 frames/s, 8 times as fast; noise with its cause, and recorded events without.
/usr/bin/python3 - <<'PYTHON' || fail "a recipe has other events"
import gst_eventcamera as ec
import numpy as np

assert 0.15 < ec.stream("phone.raw").duration < 0.21, ec.stream("phone.raw").duration
causes = set(np.load("noisy.npz")["cause"])
assert {0, 2, 4} <= causes and 1 not in causes, causes
PYTHON
event-convert left.raw merged.npz 2>&1 | sed 's/ events.*//' >events
event-convert merged.raw merged.npz 2>&1 | sed 's/ events.*//' >merged
[ "$(cat merged)" = "$((2 * $(cat events)))" ] || fail "$(cat merged) events of twice $(cat events) are merged"
