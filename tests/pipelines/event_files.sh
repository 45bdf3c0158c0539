#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Event files as users handle them: converted, inspected, and played. No command takes ten seconds, but a
# machine under load may take so much longer.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"

convert() {
  echo "event-convert $*"
  timeout 600 "$BUILD/pipelines/event-convert" "$@"
}

# Extensions of files that are written and read, and the elements, as GStreamer's registry knows them.
/usr/bin/python3 - >elements <<'PYTHON'
import gi

gi.require_version("Gst", "1.0")
from gi.repository import Gst

Gst.init(None)
for factory in Gst.Registry.get().get_feature_list(Gst.ElementFactory):
    for key in "output-extensions", "input-extensions":
        for entry in (factory.get_metadata(key) or "").replace(",", ";").split(";"):
            if entry:
                print(key[:-len("-extensions")], factory.get_name(), entry.split()[0])
PYTHON
mapfile -t written < <(awk '$1 == "output" { print $3 }' elements)
[ ${#written[@]} -ge 11 ] || fail "writers of ${written[*]}"

# The documents have them all.
while read -r _ element ending; do
  grep -q "^|.*\`\.$ending\`.*\`$element\b" "$SOURCE/docs/formats.md" || fail "docs/formats.md: .$ending and $element"
  grep -q "^\.B.* \.$ending\b" "$SOURCE/pipelines/man/event-convert.1" || grep -q "^\.RB ( \.$ending )" "$SOURCE/pipelines/man/event-convert.1" ||
    fail "the manual page of event-convert: .$ending"
done <elements

timeout 600 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=60 ! eventsim-diff ! evtenc format=EVT3 ! filesink location=ball.raw

# To each format and from there to text without a sensor size: the same events. The content of a file tells its
# format, whatever its name is.
convert ball.raw ball.csv
for ending in "${written[@]}"; do
  [ -f "ball.$ending" ] || convert ball.raw "ball.$ending"
  cp "ball.$ending" "content of $ending.bin"
  convert "content of $ending.bin" back.csv
  cmp ball.csv back.csv || fail "ball.$ending has other events"
done

# A file of MATLAB, by the line of the documentation.
/usr/bin/python3 "$SOURCE/tests/formats/n_mnist.py" .
eval "$(grep "^/usr/bin/python3 .*loadmat" "$SOURCE/docs/formats.md")"
convert n-mnist.npz matlab.csv
cmp n-mnist.bin.lines matlab.csv || fail "n-mnist.mat has other events"

# Names are printed as they are, whatever the locale.
LC_ALL=C convert ball.raw "Bälle über 物.dat" >named
grep -q "to Bälle über 物.dat" named || fail "the name was printed as $(cat named)"
LC_ALL=C convert "Bälle über 物.dat" named.csv
cmp ball.csv named.csv || fail "the name was not found"
if LC_ALL=C convert "kein Bällchen.dat" none.csv 2>named; then fail "no file was converted"; fi
grep -q "kein Bällchen.dat: No such file" named || fail "the error says $(cat named)"

# A sensor size that the file does not state.
convert --width=500 --height=400 ball.npy sized.raw
grep -aq "geometry 500x400" sized.raw || fail "the size is not the one that was set: $(grep -a geometry sized.raw)"

# Options of the formats.
convert --format=esim ball.raw esim.csv
convert --time-unit=nanoseconds esim.csv esim-back.csv
cmp ball.csv esim-back.csv || fail "esim.csv in nanoseconds has other events"
convert --column-order=txyp --time-unit=microseconds ball.csv set.csv
cmp ball.csv set.csv || fail "ball.csv with its columns and unit set has other events"
convert --format=EVT2 ball.raw evt2.raw
grep -aq "format EVT2" evt2.raw || fail "the words are not EVT2"
convert --compression=none ball.raw plain.aedat4
[ "$(stat -c %s plain.aedat4)" -gt "$(stat -c %s ball.aedat4)" ] || fail "plain.aedat4 is compressed"

# h5py and eventhdf5dec read what eventhdf5sink wrote before it was killed, up to the last second. It is
# killed after a copy has events, however long a machine under load takes for them.
for layout in dsec metavision; do
  rm -f killed.h5
  "$GST_LAUNCH" -q videotestsrc pattern=ball is-live=true ! eventsim-diff ! eventhdf5sink format=$layout location=killed.h5 &
  for _ in {1..600}; do
    sleep 0.1
    cp killed.h5 copy.h5 2>/dev/null || continue
    "$BUILD/pipelines/event-convert" copy.h5 copy.csv >/dev/null 2>&1 || continue
    [ "$(wc -l <copy.csv)" -gt 1000 ] && break
  done
  sleep 2
  kill -KILL $!
  wait $! || true
  /usr/bin/python3 - killed.h5 <<'END' || fail "h5py does not read what was killed"
import sys
import h5py
with h5py.File(sys.argv[1]) as killed:
    events = killed["CD/events" if "CD" in killed else "events/t"]
    assert len(events) > 1000, len(events)
END
  convert killed.h5 killed.csv
  [ "$(wc -l <killed.csv)" -gt 1000 ] || fail "eventhdf5dec does not read what was killed"
done

# The discoverer of players.
for ending in "${written[@]}"; do
  timeout 600 gst-discoverer-1.0 -v "ball.$ending" >discovered || fail "gst-discoverer-1.0 ball.$ending"
  for found in application/x-event-camera "Duration: 0:00:01.9" "Seekable: yes"; do
    grep -q "$found" discovered || fail "gst-discoverer-1.0 ball.$ending: $found"
  done
done

printf 'A text of words.\nAnd 1 2 3 0 in it.\n%.0s' $(seq 40) >words.txt

# Bags of recorders, with the same events and images in every file.
/usr/bin/python3 "$SOURCE/tests/formats/bag_files.py" .
for bag in evt3.mcap:x-mcap evt3.bag:x-rosbag evt3.db3:x-rosbag2-db3; do
  file=${bag%:*}
  gst-typefind-1.0 "$file" | grep -q " - application/${bag#*:}" || fail "$file is not recognised"
  convert "$file" "$file.aedat4" 2>left-out
  if grep "dropped" left-out; then fail "frames of $file are dropped"; fi
  grep -q "$file: note: The file also has topics /second/events" left-out || fail "nobody tells of /second/events in $file"
  convert "$file.aedat4" "$file.csv"
  cmp evt3.mcap.csv "$file.csv" || fail "$file has other events"
done
[ "$(wc -l <evt3.mcap.csv)" = 6001 ] || fail "evt3.mcap has $(wc -l <evt3.mcap.csv) lines"

printf x >evt3.db3-wal
convert evt3.db3 evt3.npy 2>left-out
grep -q "evt3.db3: warning: messages in evt3.db3-wal are not read" left-out || fail "nobody tells of evt3.db3-wal"

# Streams that begin apart. Without an index, only images that begin with the events are found.
/usr/bin/python3 "$SOURCE/tests/formats/apart_bags.py" .
for bag in late-*.bag late-*.mcap late-*.db3; do
  [[ $bag == late-images-no-index* ]] && continue
  convert "$bag" apart.aedat4 2>left-out
  if grep . left-out; then fail "$bag is not converted whole"; fi
  convert apart.aedat4 apart.csv 2>left-out
  grep -q ": dropped: 24 frames$" left-out || fail "frames of $bag: $(cat left-out)"
  name=${bag%%.*}
  cmp "${name%-no-index}.lines" apart.csv || fail "$bag has other events"
  convert --from=0.9 --to=1.1 "$bag" apart.csv
  [ "$(grep -vc t apart.csv)" = 200 ] || fail "a part of $bag has $(grep -vc t apart.csv) events"
  rm "$bag"
done

# Frames come along where they can; what is dropped is said.
timeout 600 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=40 ! video/x-raw,format=GRAY8,framerate=25/1 ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux ! filesink location=framed.aedat4
convert framed.aedat4 framed.csv 2>left-out
grep -q ": dropped: 40 frames$" left-out || fail "frames are dropped: $(cat left-out)"
convert framed.aedat4 again.aedat4 2>left-out
if grep "dropped" left-out; then fail "frames are dropped of an AEDAT 4 file"; fi
for file in framed.aedat4 again.aedat4; do
  timeout 600 "$GST_LAUNCH" -q filesrc location=$file ! aedatdemux name=d  d.video_0 ! queue ! filesink location=$file.frames
done
cmp framed.aedat4.frames again.aedat4.frames || fail "again.aedat4 has other frames"

# Of several streams of events, one is converted; the user is told.
timeout 600 "$GST_LAUNCH" -q filesrc location=framed.aedat4 ! aedatdemux name=d  d.events_0 ! queue ! mux.  d.video_0 ! queue ! mux.  aedatmux name=mux compression=none ! fdsink >plain-framed.aedat4
sed 's/FRME/EVTS/' plain-framed.aedat4 >two.aedat4
convert two.aedat4 two.csv 2>left-out
grep -q "two.aedat4: warning: Only the first of 2 streams of events is converted" left-out || fail "the user is told: $(cat left-out)"
cmp framed.csv two.csv || fail "two.csv has other events"

# Labels come along where they can.
timeout 600 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=20 ! eventsim-dvs label=true ! eventnpzenc ! filesink location=labelled.npz
for ending in npz h5 csv; do
  format=()
  [ $ending = csv ] && format=(--format=labels)
  convert "${format[@]}" labelled.npz "labels.$ending" 2>left-out
  if grep "dropped" left-out; then fail "labels are dropped of labels.$ending"; fi
done
timeout 60 "$GST_LAUNCH" -q filesrc location=labelled.npz ! eventnpzdec ! eventcrop left=50 right=170 top=60 bottom=100 ! eventcsvenc format=labels ! filesink location=region-labels.csv
convert --format=labels --crop=100x80+50+60 labelled.npz cropped-labels.csv
cmp region-labels.csv cropped-labels.csv || fail "labels of a region are lost"
for ending in csv raw hdf5 aedat4; do
  convert labelled.npz "unlabelled.$ending" 2>left-out
  grep -q "labelled.npz: dropped: labels$" left-out || fail "nobody tells of labels that unlabelled.$ending lacks"
done

# Parts of a recording: from 0.5 s after its first event to before 1 s.
awk -F, 'NR == 2 { start = $1 } NR == 1 || ($1 >= start + 500000 && $1 < start + 1000000)' ball.csv >expected.csv
[ "$(wc -l <expected.csv)" -gt 10000 ] || fail "the part has $(wc -l <expected.csv) lines"
for ending in "${written[@]}"; do
  convert --from=0.5 --to=1 "ball.$ending" "part.$ending" 2>left-out
  if grep "dropped" left-out; then fail "something of a part is dropped"; fi
  convert "part.$ending" part-back.csv
  cmp expected.csv part-back.csv || fail "a part of ball.$ending has other events"
done

# A region of the sensor, which becomes the sensor.
awk -F, 'NR == 1 || ($2 >= 50 && $2 < 150 && $3 >= 60 && $3 < 140) { if (NR > 1) { $2 -= 50; $3 -= 60 } print }' OFS=, ball.csv >expected.csv
[ "$(wc -l <expected.csv)" -gt 1000 ] || fail "the region has $(wc -l <expected.csv) lines"
convert --crop=100x80+50+60 ball.raw region.raw
grep -aq "geometry 100x80" region.raw || fail "the size is not that of the region: $(grep -a geometry region.raw)"
convert region.raw region.csv
cmp expected.csv region.csv || fail "region.raw has other events"
convert --crop=100x80+50+60 framed.aedat4 region.aedat4 2>left-out
grep -q ": dropped: 40 frames$" left-out || fail "frames are cropped: $(cat left-out)"

# A part without events is empty, with a warning.
for part in --from=100 --crop=1x1+0+0; do
  convert $part ball.raw empty.csv 2>warnings
  grep -q "ball.raw: warning: no events in this part; the recording lasts 1\.9[0-9]* s" warnings || fail "$part: $(cat warnings)"
  [ "$(wc -l <empty.csv)" -le 1 ] || fail "$part has events"
done

# Several files, to a directory that is made.
mkdir inputs
cp ball.raw inputs/a.raw
cp ball.dat inputs/b.dat
convert --output-directory=some/outputs --extension=csv inputs/*
for name in a b; do cmp ball.csv some/outputs/$name.csv || fail "$name.csv has other events"; done
convert --to=1 --output-directory=some inputs/*
[ "$(stat -c %s some/a.raw)" -lt "$(stat -c %s ball.raw)" ] || fail "a.raw is whole"
[ -s some/b.dat ] || fail "there is no b.dat"
if convert --output-directory=others --extension=.csv inputs/a.raw nowhere.raw inputs/b.dat; then fail "nowhere.raw was converted"; fi
cmp ball.csv others/b.csv || fail "b.dat was not converted after a failure"

# Names that begin with a dash, and links, which stay.
cp ball.raw ./-ball.raw
convert -- -ball.raw -ball.csv
cmp ball.csv ./-ball.csv || fail "-ball.csv has other events"
mkdir elsewhere
echo old >elsewhere/target
ln -s elsewhere/target link.csv
convert ball.raw link.csv
[ -L link.csv ] || fail "the link is replaced"
cmp ball.csv elsewhere/target || fail "the file that the link points to has other events"

# Videos are simulated; the file has the events of the pipeline.
timeout 60 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=20 ! video/x-raw,format=I420,framerate=25/1 ! x264enc ! mp4mux ! filesink location=scene.mp4
timeout 60 "$GST_LAUNCH" -q filesrc location=scene.mp4 ! decodebin ! eventsim-diff ! eventcsvenc ! filesink location=expected.csv
convert scene.mp4 simulated.csv --simulator eventsim-diff
cmp expected.csv simulated.csv || fail "the events of a video are others"
convert scene.mp4 default.raw
[ "$(stat -c %s default.raw)" -gt 1000 ] || fail "the default simulator finds no events"
# Slow motion: recorded at 200 frames/s.
convert scene.mp4 fast.csv --simulator eventsim-diff --speed 8
awk -F, 'NR == 1 { print; next } { printf "%d,%s,%s,%s\n", $1 / 8, $2, $3, $4 }' OFS=, expected.csv | tail -1 >expected
awk -F, -v want="$(cut -d, -f1 expected)" 'END { exit !($1 > want - 10 && $1 < want + 10) }' fast.csv ||
  fail "the last event at 8 times the speed is $(tail -1 fast.csv)"
[ "$(wc -l <fast.csv)" = "$(wc -l <expected.csv)" ] || fail "the speed changes the number of events"

# Pictures, by a pattern and by a list.
mkdir pictures
timeout 60 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=20 ! video/x-raw,format=GRAY8,framerate=25/1 ! pngenc snapshot=false ! multifilesink location="pictures/a %d.png"
timeout 60 "$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=20 ! video/x-raw,format=GRAY8,framerate=25/1 ! eventsim-diff ! eventcsvenc ! filesink location=expected.csv
convert 'pictures/*.png' pictures.csv --framerate 25 --simulator eventsim-diff
cmp expected.csv pictures.csv || fail "the events of pictures are others"
for i in {0..19}; do echo "$(awk "BEGIN { print $i / 25 }") pictures/a $i.png"; done >pictures.txt
convert pictures.txt listed.csv --simulator eventsim-diff
cmp expected.csv listed.csv || fail "the events of a list of pictures are others"
convert "videotestsrc pattern=ball num-buffers=20 ! video/x-raw,format=GRAY8,framerate=25/1" piped.csv --simulator eventsim-diff
cmp expected.csv piped.csv || fail "the events of a pipeline are others"

# Films that play everywhere, with even sides; slower, and larger.
convert --crop=251x201+20+20 ball.raw odd.raw
convert odd.raw film.mp4 --speed 0.5
convert ball.raw part.mp4 --from 0.5 --to 1 --speed 0.5 | grep -q "^30 pictures" || fail "part.mp4 has other pictures"
timeout 60 gst-discoverer-1.0 part.mp4 | grep -q "Duration: 0:00:01.000" || fail "part.mp4: $(timeout 60 gst-discoverer-1.0 part.mp4)"
timeout 60 gst-discoverer-1.0 -v film.mp4 >discovered
for found in "profile=(string)high" "chroma-format=(string)4:2:0" "Width: 252" "Height: 202" "Frame rate: 30/1" "Duration: 0:00:02.5"; do
  grep -q "$found" discovered || fail "film.mp4 lacks $found: $(cat discovered)"
done
# Each picture of a GIF, and a PNG, is one that eventrender draws.
convert ball.raw ball.gif
convert ball.raw ball.png
convert ball.raw sheet.png --sheet 4x3 --scale 0.5
convert scene.mp4 over.png --over-frames
convert framed.aedat4 over.gif --over-frames
for rate in 25 30; do
  timeout 60 "$GST_LAUNCH" -q filesrc location=ball.raw ! evtdec ! eventrender ! video/x-raw,format=RGB,framerate=$rate/1 ! filesink location=drawn$rate
done
/usr/bin/python3 - <<'PYTHON'
import numpy as np
from PIL import Image, ImageSequence

drawn, drawn30 = (np.fromfile(f"drawn{rate}", np.uint8).reshape(-1, 240, 320, 3) for rate in (25, 30))
gif = np.stack([np.asarray(picture.convert("RGB")) for picture in ImageSequence.Iterator(Image.open("ball.gif"))])
assert gif.shape == drawn.shape and (gif == drawn).all(), "the pictures of ball.gif are others"
assert Image.open("ball.gif").info["duration"] == 40
assert (np.asarray(Image.open("ball.png")) == drawn30).all((1, 2, 3)).any(), "ball.png is another picture"
assert Image.open("sheet.png").size == (4 * 160 + 3 * 2, 3 * 120 + 2 * 2)
over = np.asarray(Image.open("over.png").convert("RGB")).reshape(-1, 3).astype(int)
coloured = (np.ptp(over, axis=1) > 20).mean()
assert 0.001 < coloured < 0.2, f"{coloured} of the pixels over frames show events"
assert Image.open("over.gif").n_frames > 20
PYTHON

# Recordings joined, merged and reversed.
convert ball.raw odd.raw joined.csv --join
[ "$(wc -l <joined.csv)" = $(($(wc -l <ball.csv) + $(convert odd.raw odd.csv | sed -n 's/ events.*//p'))) ] || fail "joined.csv has $(wc -l <joined.csv) lines"
head -n "$(wc -l <ball.csv)" joined.csv | cmp ball.csv - || fail "the first of two joined recordings is changed"
sort -t, -k1n -s joined.csv | cmp joined.csv - || fail "joined recordings go back in time"
convert ball.raw odd.raw merged.npz --merge | grep -q "^$(($(wc -l <joined.csv) - 1)) events" || fail "merged.npz has other events"
convert ball.raw reversed.raw --reverse
convert reversed.raw again.csv --reverse
/usr/bin/python3 - ball.csv again.csv <<'PYTHON'
import sys

import numpy as np

first, again = (np.loadtxt(path, delimiter=",", skiprows=1, dtype=np.int64) for path in sys.argv[1:])
assert (first[np.lexsort(first.T[::-1])] == again[np.lexsort(again.T[::-1])]).all(), "reversed twice, events are others"
PYTHON

# Errors say what is wrong.
refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  if convert "$@" 2>errors; then fail "$* was converted"; fi
  cat errors
  grep -q -e "$words" errors || fail "the error does not say \"$words\""
}
refused "words.txt: error: Cannot read" words.txt words.raw
refused "unknown extension" ball.raw ball.mp3
GST_PLUGIN_PATH= GST_PLUGIN_SYSTEM_PATH=/nowhere GST_REGISTRY=none.bin \
  refused "plugin eventcam.*meson devenv -C build -w \\." ball.raw out.dat
refused "needs --output-directory" --extension=dat ball.raw ball.es
refused "ball.raw and ball.csv would both become outputs/ball.dat" --output-directory=outputs --extension=dat ball.raw ball.csv
refused "less than --to" --from=2 --to=1 ball.raw out.dat
for region in 100x80 1x1+-1+0 "10x10+0+0 "; do
  refused "needs WIDTHxHEIGHT" --crop="$region" ball.raw out.dat
done
refused "region 100x80+250+60 is not within the sensor" --crop=100x80+250+60 ball.raw out.dat
refused "choose one of EVT2 EVT21 EVT3 EVT4" ball.raw other.raw --format=EVT5
refused "does not apply to .dat" ball.raw ball.dat --format=rpg
refused "can only be read" ball.raw ball.aedat
refused "only to reading text, NumPy or HDF5" --time-unit=seconds ball.raw other.raw
refused "only to reading files that may lack a sensor size" --width=320 ball.es other.raw
touch nothing
refused "neither its content nor its extension" nothing out.dat
# A failure does not stop the others.
mkdir -p outputs/ball.csv
cp ball.raw other-ball.raw
refused "outputs/ball.csv is a directory" --output-directory=outputs --extension=csv ball.raw other-ball.raw
[ -s outputs/other-ball.csv ] || fail "a failure stopped the other conversions"
# Files of others are left alone, whatever their names.
cp ball.raw rest.raw.part
convert rest.raw.part rest.raw
cmp ball.raw rest.raw.part || fail "the input rest.raw.part was written to"
[ -s rest.raw ] || fail "rest.raw was not written"
# Pipes and devices are neither read in part nor replaced.
mkfifo pipe.raw
ln -s /dev/full device.dat
refused "is not a regular file; save it to a file first" <(cat ball.raw) out.dat
refused "pipe.raw is not a regular file, and would be replaced" ball.raw pipe.raw
refused "device.dat is not a regular file, and would be replaced" ball.raw device.dat
if [ ! -p pipe.raw ] || [ ! -L device.dat ]; then fail "a pipe or a link to a device is replaced"; fi
mkdir folder.raw
refused "Is a directory" folder.raw out.dat
(
  trap '' XFSZ
  ulimit -f 20
  refused "File too large. Set the environment variable TMPDIR" ball.raw large.npz
)
TMPDIR=/nowhere refused "temporary file in /nowhere: No such file" ball.raw nowhere.npz
refused "files of MATLAB are not read.*docs/formats.md" n-mnist.mat out.dat
refused "no events to convert" images.bag out.dat
head -c 100001 ball.raw >short.raw
convert short.raw short.dat 2>warnings
grep -q "Corrupt data at byte " warnings || fail "no warning about a truncated file"
refused "needs IN and OUT.*--join" ball.raw ball.dat out.raw
refused "exclude each other" --join --reverse ball.raw ball.dat out.raw
refused "no picture matches" 'none/*.png' out.raw
printf '0 pictures/a 0.png\n1 nowhere.png\n' >missing.txt
refused "No such file or directory: .*nowhere.png" missing.txt out.raw
refused "with --framerate" 'pictures/*.png' out.raw
refused "no frames to draw over" --over-frames ball.raw out.mp4
refused "apply only to .mp4" --scale 2 ball.raw out.dat
refused "--speed applies to films" --speed 2 ball.raw out.dat

# What is in a file.
timeout 60 "$BUILD/pipelines/event-info" --json ball.raw framed.aedat4 short.raw >info.json
timeout 60 "$BUILD/pipelines/event-info" framed.aedat4 --plot rate.png | tee info
timeout 60 "$BUILD/pipelines/event-info" ball.raw 2>errors | true
[ ! -s errors ] || fail "a pipe that closes: $(cat errors)"
grep -q "^  events  *[0-9,]*, [0-9.]* % ON" info || fail "the number of events is not told"
/usr/bin/python3 - <<'PYTHON'
import json

import numpy as np
from PIL import Image

ball, framed, short = json.load(open("info.json"))
t, x, y, p = np.loadtxt("ball.csv", delimiter=",", skiprows=1, dtype=np.int64).T
assert (ball["width"], ball["height"], ball["events"]) == (320, 240, len(t)), ball
assert ball["on-share"] == p.mean() and ball["active-share"] == len(np.unique(y * 320 + x)) / (320 * 240), ball
assert ball["max-rate"] == np.bincount((t - t[0]) // 10000).max() * 100 and not ball["damage"], ball
assert framed["frames"] == 40 and len(framed["streams"]) == 2, framed
assert short["damage"] == {"corrupt-places": 1} and "Corrupt data at byte" in short["warnings"][0], short
assert Image.open("rate.png").size[0] > 1000
PYTHON
{
  echo t,x,y,p
  for t in {1..400}; do printf '%d,%d,%d,1\n' $((2500 * t)) $((t % 40)) $((t % 30)) $((2500 * t)) 50 60; done
} >hot.csv
[ "$(timeout 60 "$BUILD/pipelines/event-info" hot.csv | grep "hot pixels")" = "  hot pixels  1: (50, 60)" ] || fail "the hot pixel is not found"

# Interrupted, it completes the file.
has_begun() { # PROCESS FILE: it has written 10 kB to the file, or keeps them in a temporary one
  local files
  mapfile -t files < <(find "/proc/$1/fd" -lname "*/events-?????? (deleted)" 2>/dev/null)
  stat -L -c %s "$2" "${files[@]}" 2>/dev/null | awk '$1 >= 10000 { begun = 1 } END { exit !begun }'
}
timeout 600 "$GST_LAUNCH" -q videotestsrc pattern=snow num-buffers=150 ! eventsim-frame ! evtenc ! filesink location=long.raw
for interruption in "INT raw" "INT npy" "INT npz" "INT aedat4" "INT h5" "INT hdf5" "INT mcap" "TERM dat" "HUP es"; do
  read -r signal ending <<<"$interruption"
  echo "event-convert long.raw interrupted.$ending"
  "$BUILD/pipelines/event-convert" long.raw "interrupted.$ending" 2>interruption &
  converting=$!
  while kill -0 $converting && ! has_begun $converting "interrupted.$ending.part"; do sleep 0.01; done
  kill -$signal $converting || true
  [ $signal != HUP ] || kill -HUP $converting || true # again, by the shell
  if wait $converting; then echo "it was already done"; else grep -q interrupted interruption; fi
  convert "interrupted.$ending" part.dat 2>warnings | tee count
  grep -q "^[1-9][0-9]* events" count || fail "no events in interrupted.$ending"
  if grep -q warning: warnings; then fail "interrupted.$ending: $(cat warnings)"; fi
  [ ! -e "interrupted.$ending.part" ] || fail "interrupted.$ending.part is left"
done

# Not by a terminal that closes after nohup.
nohup "$BUILD/pipelines/event-convert" long.raw whole.dat >interruption 2>&1 &
converting=$!
while kill -0 $converting && ! has_begun $converting whole.dat.part; do sleep 0.01; done
kill -HUP $converting || true
wait $converting || fail "nohup: $(cat interruption)"

# A whole file is not replaced by one that is interrupted.
cp ball.aedat4 kept.aedat4
"$BUILD/pipelines/event-convert" --compression=zstd-high long.raw kept.aedat4 2>interruption &
converting=$!
while kill -0 $converting && [ "$(stat -c %s kept.aedat4.part 2>/dev/null || echo 0)" -lt 10000 ]; do sleep 0.01; done
kill -INT $converting || true
if wait $converting; then fail "it was already done"; fi
grep -q "interrupted: kept.aedat4 is unchanged; the events so far are in kept.aedat4.part" interruption ||
  fail "the user is told: $(cat interruption)"
cmp ball.aedat4 kept.aedat4 || fail "an interrupted file replaced a whole one"
convert kept.aedat4.part kept.csv
[ "$(wc -l <kept.csv)" -gt 100 ] || fail "the events so far are lost"

# Recordings of cameras.
recordings=$SHARED_DATA/events
if [ ! -d "$recordings" ]; then
  echo "no $recordings: no recording was read"
  exit 77
fi
davis=$recordings/davis346-frames-events-imu.aedat4
convert "$davis" davis.csv 2>left-out | tee count
grep -q "^117667 events" count || fail "$davis has $(cat count)"
grep -q ": dropped: 3 frames, 15 triggers, 130 IMU samples$" left-out || fail "the user is told: $(cat left-out)"

# Triggers, frames and IMU samples come along where both formats have them.
complete() { # IN OUT
  convert "$1" "$2" 2>left-out
  if grep "dropped" left-out; then fail "something of $1 is dropped of $2"; fi
}
complete "$recordings/evt3-640x480-triggers.raw" triggers.hdf5
complete triggers.hdf5 triggers.raw
complete triggers.raw triggers-again.hdf5
complete "$davis" davis.aedat4
complete davis.aedat4 davis-again.aedat4
cmp davis.aedat4 davis-again.aedat4 || fail "the copy of a copy is another file"
/usr/bin/python3 - triggers.hdf5 triggers-again.hdf5 <<'PYTHON'
import sys

import h5py

first, again = (h5py.File(path)["EXT_TRIGGER/events"][:] for path in sys.argv[1:3])
assert len(first) > 0 and (first == again).all(), "triggers are others on the way back"
PYTHON
echo "all files were read and written"
