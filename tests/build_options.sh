#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Configures and builds the plugins and programs with each feature disabled. Without the simulators
# nothing may need OpenCV.
set -eu
cd "$(dirname "$0")/.."
builds=$(mktemp -d)
trap 'rm -rf "$builds"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

without() { # FEATURE...
  echo "Without ${*#-D}"
  build=$builds/without$(printf -- '-%s' "${@#-D}")
  ./compile "$build" -Dtests=false -Dintrospection=disabled -Dbuildtype=plain -Dwerror=true \
    --prefix="$builds/installed" \
    "${@/%/=disabled}"
}

plugins() {
  (cd "$build/elements" && find . -name '*.so' | sort | tr '\n' ' ')
}

without -Deventsim
if grep -q opencv "$build/compile_commands.json" "$build/build.ninja"; then
  fail "OpenCV is in the commands of a build without simulators"
fi
[ "$(plugins)" = "./eventcam/libgsteventcam.so ./eventsimgl/libgsteventsimgl.so " ] || fail "built $(plugins)"

without -Deventsim -Daedat
without -Deventsim -Dhdf5
without -Deventsim -Dnpz
without -Deventcam # finds OpenCV, although it is not in the prefix
[ "$(plugins)" = "./eventsim/libgsteventsim.so ./eventsimgl/libgsteventsimgl.so " ] || fail "built $(plugins)"

without -Deventcam -Deventsimgl
if grep -q gstreamer-gl "$build/compile_commands.json"; then
  fail "OpenGL is in the commands of a build without simulators on the GPU"
fi
[ "$(plugins)" = "./eventsim/libgsteventsim.so " ] || fail "built $(plugins)"
