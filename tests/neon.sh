#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the event core for 64-bit Arm and runs its tests on an emulator: kernels on NEON, compared with
# the reference. Debian's packages for Arm are unpacked in the user's cache, not installed: with a root
# below a path with spaces, pkg-config's answers are useless.
set -euo pipefail
cd "$(dirname "$0")/.."
build="build-neon"
root=${XDG_CACHE_HOME:-$HOME/.cache}/gst-eventsim/arm64-root
suite=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
packages=(libgstreamer-plugins-base1.0-dev libgtest-dev libhwy-dev libjson-glib-dev libopencv-video-dev
  libpng-dev libyaml-dev zlib1g-dev)
contents="$suite ${packages[*]}"
tests=(denoise dense_flow dvs luma lucas_kanade reference render)
# The equations; the largest pictures take minutes on the emulator.
export GTEST_FILTER='*Reference*:*Equality*:*Target*:-*257x300*:*259x261*'

if [ "$(cat "$root/contents" 2>/dev/null)" != "$contents" ]; then
  echo "Unpacking packages for Arm in $root"
  rm -rf "$root"
  mkdir -p "$root"
  tests/mmdebstrap.sh host --variant=extract --architectures=arm64 --include="${packages[*]}" |
    tar --extract --directory="$root" --exclude='./dev/*' --no-same-owner
  # Alternatives, which installing them would choose.
  ln -s blas/libblas.so.3 lapack/liblapack.so.3 "$root/usr/lib/aarch64-linux-gnu"
  echo "$contents" >"$root/contents"
fi

mkdir -p $build
cat >$build/cross.ini <<CROSS
[constants]
root = '$root'
sysroot = ['--sysroot=' + root]
[binaries]
c = 'aarch64-linux-gnu-gcc'
cpp = 'aarch64-linux-gnu-g++'
ar = 'aarch64-linux-gnu-ar'
strip = 'aarch64-linux-gnu-strip'
pkgconfig = 'pkg-config'
exe_wrapper = ['qemu-aarch64', '-L', root]
[properties]
sys_root = root
pkg_config_libdir = [root / 'usr/lib/aarch64-linux-gnu/pkgconfig', root / 'usr/share/pkgconfig']
[built-in options]
c_args = sysroot
cpp_args = sysroot
c_link_args = sysroot
cpp_link_args = sysroot
[host_machine]
system = 'linux'
cpu_family = 'aarch64'
cpu = 'aarch64'
endian = 'little'
CROSS
targets=("${tests[@]/%/_test}")
./compile $build --cross-file=$build/cross.ini -Dtests=true -Dintrospection=disabled -Deventsimgl=disabled \
  -Doptimization=2 "${targets[@]}"
# One program takes longer than all others: each processor runs a part of every program.
GTEST_TOTAL_SHARDS=$(nproc)
export GTEST_TOTAL_SHARDS
runs=()
for ((i = 0; i < GTEST_TOTAL_SHARDS; ++i)); do
  GTEST_SHARD_INDEX=$i meson test -C $build --no-rebuild --print-errorlogs --num-processes 1 \
    --logbase "testlog-$i" "${tests[@]}" &
  runs+=($!)
done
for run in "${runs[@]}"; do wait "$run"; done
