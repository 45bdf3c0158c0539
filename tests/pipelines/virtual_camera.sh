#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Another application reads the virtual camera through PipeWire.
set -eu
if [ -z "${EVENTSIM_TEST_SESSION:-}" ]; then exec env EVENTSIM_TEST_SESSION=1 dbus-run-session -- "$0"; fi
source "$SOURCE/tests/pipelines/scratch_folder.sh"

export XDG_RUNTIME_DIR=$work/run HOME=$work XDG_CONFIG_HOME=$work/config XDG_STATE_HOME=$work/state
mkdir -m 700 run
started=()
trap 'kill "${started[@]}" 2>/dev/null || true; wait; rm -rf "$work"' EXIT
wait_for() { # COMMAND...
  for _ in $(seq 600); do
    if "$@" >/dev/null 2>&1; then return; fi
    sleep 0.1
  done
  tail -n 20 *.log
  fail "$*"
}
start() { # PROGRAM ARGUMENT...
  "$@" >"$(basename "$1").log" 2>&1 &
  started+=($!)
}
unset G_DEBUG # warnings of daemons about the machine do not matter
start pipewire
wait_for test -S run/pipewire-0
start wireplumber
wait_for sh -c 'pw-cli ls Client | grep WirePlumber'
# Pictures come late, as the first one of a webcam does.
start "$BUILD/pipelines/virtual-camera" --simulator "eventsim-diff palette=light ! identity sleep-time=200000"
wait_for sh -c 'pw-cli ls Node | grep "node.description = \"Event camera\""'
pw-cli ls Node | grep -A1 'node.name = "event-camera"' | grep -q 'media.class = "Video/Source"' || fail "it is not a camera"
timeout 60 "$GST_LAUNCH" -q pipewiresrc target-object=event-camera num-buffers=10 ! videoconvert ! \
  video/x-raw,format=GRAY8,width=320,height=240 ! filesink location=pictures
[ "$(stat -c %s pictures)" -eq $((10 * 320 * 240)) ] || fail "$(stat -c %s pictures) bytes of 10 pictures"
# The ball moves on a white background.
[ "$(tail -c $((320 * 240)) pictures | od -An -v -tu1 -w1 | sort -u | wc -l)" -gt 2 ] || fail "the last picture is empty"

refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  if timeout 60 "$BUILD/pipelines/virtual-camera" "$@" 2>refusal; then fail "virtual-camera $* ran"; fi
  grep -q "$words" refusal || fail "it says $(cat refusal)"
}
refused "there is no camera /nowhere" --device /nowhere
refused 'no simulator "nosuch' --simulator "nosuch palette=light"
XDG_RUNTIME_DIR=/nowhere refused "PipeWire is not running, since there is no /nowhere/pipewire-0"

if "$BUILD/pipelines/virtual-camera" --device 2>usage; then fail "--device needs a value"; fi
grep -q -- "--device DEVICE" usage || fail "the usage is $(cat usage)"
if GST_PLUGIN_PATH= GST_REGISTRY=$work/none.bin "$BUILD/pipelines/virtual-camera" 2>missing; then fail "there are no simulators"; fi
grep -q "plugin eventsim.*meson devenv -C build -w \\." missing || fail "it says $(cat missing)"
