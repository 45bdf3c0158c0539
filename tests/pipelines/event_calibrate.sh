#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# event-calibrate recovers the settings that a recording was simulated with.
set -euo pipefail
source "$SOURCE/tests/pipelines/scratch_folder.sh"
if [ ! -f "$GI_TYPELIB_PATH/GstEventCamera-1.0.typelib" ]; then
  echo "built without introspection: no Python"
  exit 77
fi

calibrate() {
  echo "event-calibrate $*"
  timeout 60 "$BUILD/pipelines/event-calibrate" "$@" 2>progress || {
    cat progress
    return 1
  }
}

"$GST_LAUNCH" -q videotestsrc pattern=zone-plate kx2=12 ky2=12 kt=5 num-buffers=16 ! video/x-raw,format=I420,width=161,height=90,framerate=25/1 ! matroskamux ! filesink location=scene.mkv

recovers() { # POSITIVE NEGATIVE TOLERANCE ELEMENT...
  local positive=$1 negative=$2 tolerance=$3
  shift 3
  "$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! "$@" positive-threshold="$positive" negative-threshold="$negative" ! evtenc ! filesink location=recorded.raw
  calibrate scene.mkv recorded.raw --element "$*" --lag 0 --to 0.3 | tee found
  grep -A 5 "^calibrated thresholds: " progress | grep -q "map correlation" || fail "no quick answer was printed"
  read -r found_positive found_negative < <(sed -n 's/.* positive-threshold=\([0-9.]*\) negative-threshold=\([0-9.]*\)$/\1 \2/p' found)
  awk -v p="$found_positive" -v n="$found_negative" -v wp="$positive" -v wn="$negative" -v by="$tolerance" \
    'BEGIN { exit !(p / wp < 1 + by && wp / p < 1 + by && n / wn < 1 + by && wn / n < 1 + by) }' ||
    fail "$*: $found_positive and $found_negative instead of $positive and $negative"
  awk '/map correlation/ { exit !($3 > 0.97) }' found || fail "$*: the maps differ"
}
# On 8-bit video all thresholds between two grey levels are equivalent.
recovers 12.5 8.5 0.1 eventsim-frame
recovers 6.5 4.5 0.2 eventsim-dense
recovers 0.2 0.3 0.05 eventsim-dvs log-eps=0.02 refractory-period=0

# A profile simulates the same events as the settings that it holds.
calibrate scene.mkv recorded.raw --element "eventsim-dvs response=log log-eps=0.02 upsampling=linear denoise=0 adaptation=0.1" --lag 0 --to 0.3 --profile camera.profile >found
element=$(grep '^eventsim-dvs' found)
for simulator in "eventsim-dvs profile=camera.profile" "$element"; do
  # shellcheck disable=SC2086
  "$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! $simulator ! evtenc ! filesink location=simulated.raw
  md5sum <simulated.raw >>sums
done
[ "$(sort -u sums | wc -l)" -eq 1 ] || fail "$(cat camera.profile) differs from $element"

# Thresholds lie between those that fit the mean and those that fit the standard deviation.
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! eventsim-dvs preset=ideal response=log log-eps=0.02 adaptation=0.5 adaptation-time=200000000 ! evtenc ! filesink location=recorded.raw
calibrate scene.mkv recorded.raw --element "eventsim-dvs preset=ideal response=log log-eps=0.02 upsampling=linear denoise=0 adaptation=0 refractory-period=0 threshold-jitter=0" --lag 0 --to 0.3 | tee found
awk '$1 == "mean" { mean = $4 / $2 } $1 == "std." { deviation = $5 / $3 } END { exit !(mean < 0.98 && deviation > 1.02 && mean * deviation > 0.96 && mean * deviation < 1.04) }' found ||
  fail "mean and standard deviation are not off by about the same factor"

# Long exposures are found.
"$GST_LAUNCH" -q videotestsrc pattern=zone-plate kx2=12 ky2=12 horizontal-speed=8 num-buffers=16 ! video/x-raw,format=I420,width=160,height=90,framerate=25/1 ! matroskamux ! filesink location=moving.mkv
"$GST_LAUNCH" -q filesrc location=moving.mkv ! decodebin ! eventsim-dvs exposure-time=34000000 ! evtenc ! filesink location=recorded.raw
calibrate moving.mkv recorded.raw --element "eventsim-dvs linear-light=false log-eps=0.05 exposure-compensation=true refractory-period=0 threshold-jitter=0 upsampling=motion overexposed-light=1.5 adaptation=0.05 denoise=-1 exposure-pulse=0" --lag 0 --to 0.3 | tee found
grep -q "exposure-time=34000000" found || fail "the long exposure is not found"

# No progress goes into a pipe; on a terminal it is one line.
[ "$(wc -l <progress)" -lt 20 ] || fail "$(wc -l <progress) lines of progress"
script -qec "stty columns 60; '$BUILD/pipelines/event-calibrate' moving.mkv recorded.raw --lag 0 --to 0.1" terminal.txt >/dev/null </dev/null
grep -qa "about 0:[0-9][0-9] left" terminal.txt || fail "no time left was printed"
tr '\r' '\n' <terminal.txt | awk 'length > 59 && /left; / { exit 1 }' || fail "progress is longer than a line of the terminal"
[ "$(grep -ca left terminal.txt)" -le 4 ] || fail "progress takes several lines"

# Changes that gain only where they were chosen are dropped.
/usr/bin/python3 - <<END
import sys
sys.path.insert(0, "$SOURCE/pipelines")
import event_calibrate as calibrate
import numpy as np

class Search:
    video = recorded = span = None
    windows = list(range(8))
    progress = calibrate.Progress(60)
    def __init__(self, gain_of):
        self.gain_of = gain_of
    def fit(self, setting, precision=None):
        return str(setting)
    balanced = fit
    def figures(self, element, span):
        return None
    def ratings(self, element, windows):
        return np.array([[0.5 + self.gain_of(window) * ("denoise" in element)] * 3 for window in windows])

calibrate.describe = lambda name, figures: name
calibrate.changes_of = lambda *_: [{"denoise": 0}]
def is_kept(gain_of):
    return "denoise" in calibrate.calibrate(Search(gain_of), "eventsim-dvs")

assert is_kept(lambda window: 0.02)
assert not is_kept(lambda window: 0.005), "a small gain"
assert not is_kept(lambda window: 0.1 * (window == 0)), "a gain in one window"
assert not is_kept(lambda window: 0.1 * (window % 2 == 0)), "a gain that is not confirmed"
# Most windows are where most events are.
recorded = np.zeros(800, [("t", "i8")])
recorded["t"] = np.sort(np.concatenate([np.arange(100) * 10_000, 500_000 + np.arange(700)]))
windows = calibrate.windows_of(recorded, calibrate.Span(-1, 1_000_000))
assert [len(window.of(recorded)) for window in windows] == [100] * 8
assert windows[3].end - windows[3].start < 1000
END

# Exposure pulses are found by their bursts of events.
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! eventsim-dvs preset=ideal response=log log-eps=0.02 exposure-pulse=0.03 exposure-lead=9000000 ! evtenc ! filesink location=recorded.raw
calibrate scene.mkv recorded.raw --element "eventsim-dvs preset=ideal response=log log-eps=0.02 upsampling=linear denoise=0 adaptation=0 refractory-period=0" --lag 0 --to 0.3 | tee found
read -r lead pulse < <(sed -n 's/.* exposure-lead=\([0-9]*\).* exposure-pulse=\([0-9.]*\) .*/\1 \2/p' found)
awk -v lead="${lead:-0}" -v pulse="${pulse:-0}" 'BEGIN { exit !(lead > 8.8e6 && lead < 9.2e6 && pulse > 0.02 && pulse < 0.045) }' ||
  fail "a pulse of ${pulse:-0}, ${lead:-0} ns before the frames"

# A video as a list of pictures, with a lag of -2 ms.
"$GST_LAUNCH" -q videotestsrc pattern=zone-plate kx2=12 ky2=12 kt=5 num-buffers=16 ! video/x-raw,format=GRAY8,width=160,height=90,framerate=25/1 ! pngenc ! multifilesink location=%02d.png
for i in $(seq 0 15); do
  printf '%s %02d.png\n' "$(awk -v i="$i" 'BEGIN { print 0.04 * i + 0.002 }')" "$i"
done >pictures.txt
"$GST_LAUNCH" -q videotestsrc pattern=zone-plate kx2=12 ky2=12 kt=5 num-buffers=16 ! video/x-raw,format=GRAY8,width=160,height=90,framerate=25/1 ! eventsim-dense positive-threshold=10 ! eventcsvenc ! filesink location=recorded.csv
calibrate pictures.txt recorded.csv --element eventsim-dense --to 0.3 --measure-from 0.3 --measure-to 0.5 --map map.png | tee found
lag=$(sed -n 's/Frames show the scene \(-*[0-9.]*\) ms later.*/\1/p' found)
awk -v lag="${lag:-0}" 'BEGIN { exit !(lag > -5 && lag < 0) }' || fail "the pictures are ${lag:-0} ms late"
without_search="eventsim-dvs refractory-period=0 refractory-reset=level threshold-jitter=0 exposure-compensation=true log-eps=0.05 overexposed-light=1 adaptation=0.05 denoise=-1 exposure-time=0 exposure-pulse=0"
calibrate scene.mkv recorded.raw --element "$without_search" --to 0.04 | tee one
grep -q "^The lag cannot be estimated from one frame interval" one || fail "a lag was estimated from one frame interval"

# The first of several frame intervals is left out, unless --from says otherwise.
for start in "" "--from 0.04" "--from 0"; do
  # shellcheck disable=SC2086
  calibrate scene.mkv recorded.raw --element "$without_search" --lag 0 --to 0.3 $start >"found$start"
done
cmp <(tail -n +2 found) <(tail -n +2 "found--from 0.04")
! cmp -s <(tail -n +2 found) <(tail -n +2 "found--from 0") || fail "the first frame interval is compared"
[ -s map.png ] || fail "no picture was written"

# The right half of the recording is noise, which a mask leaves out.
"$GST_LAUNCH" -q videotestsrc pattern=snow num-buffers=16 ! video/x-raw,format=GRAY8,width=80,height=90,framerate=25/1 ! eventsim-frame ! eventcsvenc ! filesink location=noise.csv
{
  echo t,x,y,p
  { awk -F, 'NR > 1 && $2 < 80' recorded.csv && awk -F, -v OFS=, 'NR > 1 { $2 += 80; print }' noise.csv; } | sort -t, -k 1,1n
} >half.csv
printf 'P5 160 90 255\n' >half.pgm
for _ in $(seq 90); do
  printf '\377%.0s' $(seq 80)
  printf '\0%.0s' $(seq 80)
done >>half.pgm
timeout 60 "$GST_LAUNCH" -q filesrc location=half.pgm ! decodebin ! videoconvert ! pngenc ! filesink location=half.png
calibrate pictures.txt half.csv --element eventsim-dense --lag 0 --to 0.5 --mask half.png | tee found
awk '/map correlation/ { exit !($3 > 0.9) }' found || fail "events outside the mask are compared"

# Noise does not count where the frames do not change.
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! videocrop right=81 ! videobox right=-80 ! matroskamux ! filesink location=still.mkv
"$GST_LAUNCH" -q filesrc location=still.mkv ! decodebin ! eventsim-frame positive-threshold=12.5 negative-threshold=8.5 ! eventcsvenc ! filesink location=left.csv
{
  echo t,x,y,p
  { tail -n +2 left.csv && awk -F, -v OFS=, 'NR > 1 && $2 >= 24 { $2 += 80; print }' noise.csv; } | sort -t, -k 1,1n
} >noisy.csv
calibrate still.mkv noisy.csv --element eventsim-frame --lag 0 --to 0.3 | tee found
grep -q "^[1-9][0-9]* % of the recorded events are where the frames do not change" found || fail "no share of noise is printed"
read -r positive negative < <(sed -n 's/.* positive-threshold=\([0-9.]*\) negative-threshold=\([0-9.]*\)$/\1 \2/p' found)
awk -v p="$positive" -v n="$negative" 'BEGIN { exit !(p > 11.2 && p < 13.8 && n > 7.6 && n < 9.4) }' || fail "thresholds of $positive and $negative fit noise"

# A recording that was warped to the frames has pixels that never fire.
awk -F, 'NR == 1 || $2 % 3' recorded.csv >warped.csv
calibrate pictures.txt warped.csv --element eventsim-dense --lag 0 --to 0.5 --make-mask warped.png | tee found
! grep -q "never fire" found || fail "a mask is asked for although one is written"
calibrate pictures.txt warped.csv --element eventsim-dense --lag 0 --to 0.5 | tee found
grep -q "^[1-9][0-9]* % of the pixels never fire although their neighbours do" found || fail "silent pixels are not told"
calibrate pictures.txt warped.csv --element eventsim-dense --lag 0 --to 0.5 --mask warped.png | tee found
! grep -q "never fire" found || fail "pixels outside the mask are told"

# A file with frames and events is given once.
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! videoconvert ! video/x-raw,format=GRAY8 ! tee name=t ! queue ! mux.  t. ! queue ! eventsim-frame positive-threshold=12.5 negative-threshold=8.5 ! mux.  aedatmux name=mux ! filesink location=both.aedat4
calibrate both.aedat4 --element eventsim-frame --lag 0 --to 0.3 | tee found
awk '/map correlation/ { exit !($3 > 0.97) }' found || fail "frames and events of a file differ"

# Where the video is overexposed, events of the recording are left out.
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! eventsim-frame positive-threshold=12.5 negative-threshold=8.5 ! evtenc ! filesink location=recorded.raw
"$GST_LAUNCH" -q filesrc location=scene.mkv ! decodebin ! videobalance brightness=0.4 ! matroskamux ! filesink location=bright.mkv
calibrate bright.mkv recorded.raw --element eventsim-frame --lag 0 --to 0.3 | tee found
hidden=$(sed -n 's/^\([0-9]*\) % of the recorded events are excluded: the frames are overexposed there\.$/\1/p' found)
[ "${hidden:-0}" -gt 10 ] || fail "${hidden:-0} % of the events are where the video is overexposed"
awk '/map correlation/ { exit !($3 > 0.9) }' found || fail "events are compared where the video is overexposed"

# The result is printed even if a disk is full.
ln -s /dev/full full.png
if calibrate scene.mkv recorded.raw --element eventsim-frame --lag 0 --to 0.3 --map full.png >found; then fail "a full disk was written to"; fi
grep -q "map correlation" found || fail "the result is lost: $(cat found)"

# Errors say what is wrong.
refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  if timeout 60 "$BUILD/pipelines/event-calibrate" "$@" 2>errors; then fail "event-calibrate $* succeeded"; fi
  cat errors
  grep -q "$words" errors || fail "the error does not say \"$words\""
  ! grep -q Traceback errors || fail "the error is a traceback"
  ! grep -q "^calibrated" errors || fail "the error comes after the search"
}
refused "no element" scene.mkv recorded.raw --element eventsim-nothing
refused "only eventsim-dvs has profiles" scene.mkv recorded.raw --element eventsim-frame --profile frame.profile
refused "recorded.raw: events without frames; give the video" recorded.raw
GST_PLUGIN_PATH= GST_PLUGIN_SYSTEM_PATH=/nowhere GST_REGISTRY=none.bin \
  refused "plugin eventcam.*meson devenv -C build -w \\." scene.mkv recorded.raw
printf '# no pictures\n\n' >comments.txt
refused "comments.txt: no pictures; give a line" comments.txt recorded.raw
echo "nan 00.png" >times.txt
refused "times.txt: nan is not the time of a picture" times.txt recorded.raw
printf '0.05 00.png\n0.05 01.png\n' >times.txt
refused "times.txt: the time 0.05 is not later than the one before it" times.txt recorded.raw
refused "name a simulator" scene.mkv recorded.raw --element " "
refused "argument --from: '-5' is not a number of seconds from 0 on" scene.mkv recorded.raw --from -5
for option in --profile --map; do
  refused "nowhere/file cannot be written; name a file" scene.mkv recorded.raw --element eventsim-dvs $option nowhere/file
done
refused "recorded.raw is read, so it cannot be written" scene.mkv recorded.raw --map ./recorded.raw
awk -F, -v OFS=, 'NR > 1 { $1 += 2000000000; } { print }' recorded.csv >late.csv
refused "the clocks differ: the frames are from 0.002 to 0.602 s, the events from 2000.[0-9]* to 2000.[0-9]* s" pictures.txt late.csv
refused "nothing to compare from" scene.mkv recorded.raw --element eventsim-frame --from 5

# A checkout asks for the Debian packages that the Python package depends on.
mkdir none
printf '#!/bin/sh\n' >none/dpkg-query
chmod +x none/dpkg-query
for group in calibrate dataset pipelines; do
  PATH=$PWD/none:$PATH "$SOURCE/install-packages" --check $group 2>missing || true
  for package in $(sed -n '/^Package: python3-gst-eventcamera/,/^Suggests/s/^ *\(python3-[a-z]*\),$/\1/p' "$SOURCE/debian/control"); do
    grep -qw "$package" missing || fail "$group lacks $package"
  done
done
echo "all thresholds were recovered"
