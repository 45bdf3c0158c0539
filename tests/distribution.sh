#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds in a fresh chroot of another release of Debian, as root, and tests there what depends on its
# GStreamer and libraries:
#   tests/distribution.sh SUITE     for example: testing
# Exits with status 77 if the mirror does not have the release.
set -euo pipefail
cd "$(dirname "$0")/.."
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
git ls-files -z --cached --others --exclude-standard | tar -c --null --files-from=- -f "$scratch/tree.tar"

tests/mmdebstrap.sh "$1" --variant=apt --format=null \
  --customize-hook='mkdir "$1/gst-eventsim"' \
  --customize-hook="tar-in '$scratch/tree.tar' /gst-eventsim" \
  --customize-hook='chroot "$1" bash -euc "
    cd /gst-eventsim
    ./install-packages build run tests
    apt-get install --yes --no-install-recommends libgstreamer-plugins-bad1.0-dev # GstTensorMeta, from 1.26
    # GCC warns of what the standard library does if that is precompiled.
    meson setup build -Dtests=true -Dwerror=true -Db_pch=false
    meson test -C build --print-errorlogs \
      element_{aedat,contracts,drawing,files,gl,hdf5,rtp,simulator,tensor}"'
