#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the plugins and programs with each feature disabled, beside others that have nothing to do
# with it, in one directory and in such an order that little is built again. Starts from a copy of
# build, if there is one. Nothing but one optical flow may need OpenCV.
set -eu
cd "$(dirname "$0")/.."
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
build=$scratch/build
if [ -f build/build.ninja ] && [ -w . ]; then
  build="build-options" # beside build, since paths in it are relative
  trap 'rm -rf "$scratch" "$build"' EXIT
  rm -rf "$build"
  cp -a build "$build"
fi

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

without() { # FEATURE...
  echo "Without $*"
  local feature options=()
  for feature in eventsim opencv eventsimgl eventcam aedat hdf5 npz ros analytics; do
    case " $* " in
      *" $feature "*) options+=("-D$feature=disabled") ;;
      *) options+=("-D$feature=auto") ;;
    esac
  done
  options+=(-Dtests=false -Dbenchmarks=false -Dintrospection=disabled -Dwerror=true --prefix="$scratch/installed")
  if [ -d "$build" ]; then
    meson setup --reconfigure "$build" "${options[@]}" >/dev/null
    ninja -C "$build" -t cleandead >/dev/null # what only other configurations build
  fi
  ./compile "$build" -Dbuildtype=plain "${options[@]}"
}

uses_opencv() {
  grep -qE 'opencv(4|_)' "$build/compile_commands.json" "$build/build.ninja"
}

plugins() {
  (cd "$build/elements" && find . -name '*.so' | sort | tr '\n' ' ')
}

without eventsim aedat npz analytics
without eventsim hdf5 ros
without eventsim
if uses_opencv; then fail "OpenCV is in the commands of a build without simulators"; fi
[ "$(plugins)" = "./eventcam/libgsteventcam.so ./eventsimgl/libgsteventsimgl.so " ] || fail "built $(plugins)"

without opencv
if uses_opencv; then fail "OpenCV is in the commands of a build without it"; fi
[ "$(plugins)" = "./eventcam/libgsteventcam.so ./eventsim/libgsteventsim.so ./eventsimgl/libgsteventsimgl.so " ] ||
  fail "built $(plugins)"
for element in eventsim-frame eventsim-dense eventsim-sparse eventsim-diff eventsim-dvs; do
  meson devenv -C "$build" gst-inspect-1.0 $element >"$scratch/$element" || fail "$element is missing without OpenCV"
done
grep -q dis-hq "$scratch/eventsim-dense" || fail "flow=dis-hq is missing without OpenCV"
if grep -q opencv-dis "$scratch/eventsim-dense"; then fail "flow=opencv-dis is there without OpenCV"; fi

without eventcam # finds OpenCV, although it is not in the prefix
[ "$(plugins)" = "./eventsim/libgsteventsim.so ./eventsimgl/libgsteventsimgl.so " ] || fail "built $(plugins)"

without eventcam eventsimgl
if grep -q libgstgl "$build/build.ninja"; then
  fail "OpenGL is in the commands of a build without simulators on the GPU"
fi
[ "$(plugins)" = "./eventsim/libgsteventsim.so " ] || fail "built $(plugins)"
