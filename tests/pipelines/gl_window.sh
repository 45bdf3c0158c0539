#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A window shows the picture of events that the GPU draws: the same, pixel by pixel, as the CPU's.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"
width=320 height=240

# A screen without a window manager: windows are at its corner.
Xvfb -displayfd 3 -nolisten tcp -screen 0 ${width}x${height}x24 3>screen 2>xvfb &
screen=$!
player=
trap 'kill $player $screen 2>/dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 100); do
  [ -s screen ] && break
  sleep 0.1
done
[ -s screen ] || fail "no screen: $(cat xvfb)"
DISPLAY=:$(cat screen)
export DISPLAY GST_GL_WINDOW=x11

run() {
  timeout 60 "$GST_LAUNCH" -q "$@"
}
run videotestsrc pattern=ball num-buffers=4 ! video/x-raw,format=I420,width=$width,height=$height ! \
  filesink location=frames
of_frames="rawvideoparse width=$width height=$height"
for element in frame sparse diff; do
  # shellcheck disable=SC2086
  run filesrc location=frames ! $of_frames ! eventsim-$element ! video/x-raw,format=RGB ! filesink location=pictures
  tail -c $((3 * width * height)) pictures >expected
  [ "$(od -An -v -tx1 -w3 expected | sort -u | wc -l)" -ge 3 ] || fail "the picture shows no events"

  # The last picture stays in the window.
  mkfifo video
  # shellcheck disable=SC2086
  timeout 120 "$GST_LAUNCH" -q filesrc location=video blocksize=$((width * height * 3 / 2)) ! $of_frames ! glupload ! gleventsim-$element qos=false ! \
    glimagesink sync=false >output 2>&1 &
  player=$!
  exec 4<>video # also opens if the player has failed
  timeout 60 cat frames >&4 || fail "$(cat output)"
  shown=false
  for _ in $(seq 40); do
    sleep 0.25
    run ximagesrc num-buffers=1 show-pointer=false ! videoconvert ! video/x-raw,format=RGB ! filesink location=shown
    if cmp -s shown expected; then
      shown=true
      break
    fi
  done
  $shown || fail "gleventsim-$element: $(cmp shown expected) $(cat output)"
  exec 4>&-
  wait $player || fail "$(cat output)"
  rm video
done
