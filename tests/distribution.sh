#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds and tests in a fresh chroot of another release of Debian, as root:
#   tests/distribution.sh SUITE     for example: testing
set -eu
cd "$(dirname "$0")/.."
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
git ls-files -z --cached --others --exclude-standard | tar -c --null --files-from=- -f "$scratch/tree.tar"

# A mirror may be an old snapshot; whether apt takes one is the host's decision.
eval "$(apt-config shell check_date Acquire::Check-Valid-Until)"
mmdebstrap --quiet --variant=apt --format=null --aptopt="Acquire::Check-Valid-Until \"${check_date:-true}\"" \
  --customize-hook='mkdir "$1/gst-eventsim"' \
  --customize-hook="tar-in '$scratch/tree.tar' /gst-eventsim" \
  --customize-hook='chroot "$1" bash -euc "
    cd /gst-eventsim
    ./install-packages build run tests
    ./compile build -Dtests=true -Dwerror=true
    meson test -C build --print-errorlogs --suite core --suite formats --suite wire --suite elements --suite gl"' \
  "$1"
