#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# In a video editor a simulator is an effect: a picture for every frame, at its time, the first one empty.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"

"$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=50 ! video/x-raw,format=I420,width=320,height=240,framerate=25/1 ! x264enc ! mp4mux ! filesink location=drive.mp4

# Writes rendered.mkv, the times of its pictures, and their grey levels.
rate=25
render() { # EFFECT...
  echo "+clip drive.mp4 inpoint=0.4 duration=1.0 $*"
  timeout 120 ges-launch-1.0 +clip drive.mp4 inpoint=0.4 duration=1.0 "$@" --disable-mixing --track-types=video \
    --video-caps="video/x-raw,width=320,height=240,framerate=$rate/1" --format=video/x-matroska:video/x-vp8 \
    -o rendered.mkv >log 2>&1 </dev/null || fail "$(cat log)"
  "$GST_LAUNCH" -v filesrc location=rendered.mkv ! matroskademux ! fakesink silent=false |
    sed -n 's/.*chain .*pts: \([0-9:.]*\),.*/\1/p' >times
  "$GST_LAUNCH" -q filesrc location=rendered.mkv ! decodebin ! videoconvert ! video/x-raw,format=GRAY8 ! filesink location=grey
}
levels() { # PICTURE, how bright its brightest and darkest pixels are
  od -An -v -tu1 -w1 -j $(($1 * 320 * 240)) -N $((320 * 240)) grey | sort -n | sed -n '1p;$p' | xargs
}

render
[ "$(wc -l <times)" -eq 25 ] || fail "$(wc -l <times) pictures without an effect"
mv times expected
for effect in "eventsim-diff ! videoconvert" "eventsim-sparse ! videoconvert ! videobalance saturation=0"; do
  render +effect "$effect"
  diff expected times || fail "the times of the pictures are others"
  read -r darkest brightest < <(levels 0)
  [ $((brightest - darkest)) -lt 16 ] || fail "the first picture is not empty: $darkest to $brightest"
  for picture in 1 12 24; do
    read -r darkest brightest < <(levels $picture)
    [ $((brightest - darkest)) -gt 100 ] || fail "picture $picture has no events: $darkest to $brightest"
  done
done

# A project of 30 frames/s repeats each fifth frame of the clip; its picture is drawn again.
rate=30
render +effect "eventsim-diff ! videoconvert"
[ "$(wc -l <times)" -eq 30 ] || fail "$(wc -l <times) pictures of 30"
for picture in $(seq 29); do
  read -r darkest brightest < <(levels "$picture")
  [ $((brightest - darkest)) -gt 100 ] || fail "picture $picture of 30 has no events: $darkest to $brightest"
done
