#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the Debian packages, checks them with lintian, installs, uses, upgrades and removes them in a
# fresh chroot, and runs the lines of the README from them in another, as root:
#   tests/package.sh [DIRECTORY]     the packages are left in DIRECTORY, or used if they are there
set -euo pipefail
cd "$(dirname "$0")/.."
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
packages=${1:-$scratch/packages}
mkdir -p "$packages"

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

if ! compgen -G "$packages/*.changes" >/dev/null; then
  echo "Building the packages"
  tree=$packages/gst-eventsim
  rm -rf "$tree"
  mkdir "$tree"
  git ls-files -z --cached --others --exclude-standard | xargs -0 cp --parents -t "$tree"
  (cd "$tree" && dpkg-buildpackage --no-sign) >"$packages/build.log" 2>&1 || {
    tail -n 100 "$packages/build.log" >&2
    fail "dpkg-buildpackage"
  }
  rm -rf "$tree"
fi
lintian --fail-on error --no-tag-display-limit "$packages"/*.changes

# The same packages with a higher version.
version=$(dpkg-parsechangelog -S Version)
mkdir "$scratch/new"
for package in "$packages"/*.deb; do
  if [[ $package == *-dbgsym_* ]]; then continue; fi
  dpkg-deb -R "$package" "$scratch/unpacked"
  sed -i -E "/^(Version|Depends|Recommends):/s/(Version: |= )$version\\b/&+new/g" "$scratch/unpacked/DEBIAN/control"
  dpkg-deb --root-owner-group -b "$scratch/unpacked" "$scratch/new" >/dev/null
  rm -rf "$scratch/unpacked"
done

# Runs in the chroot. No variable of the environment points to anything of the project.
cat >"$scratch/use" <<'USE'
set -eu
export DEBIAN_FRONTEND=noninteractive
files() { find / -xdev \( -path /proc -o -path /sys -o -path /tmp -o -path /var -o -path /root \) -prune -o -print | sort; }
try() {
  echo "$*"
  timeout 120 "$@" >/tmp/output 2>&1 || {
    cat /tmp/output
    exit 1
  }
}
used() {
  cd /tmp
  for element in eventsim-frame eventsim-dense eventsim-sparse eventsim-diff eventsim-dvs gleventsim-frame evtdec; do
    try gst-inspect-1.0 $element
  done
  try gst-launch-1.0 videotestsrc pattern=ball num-buffers=60 ! eventsim-diff ! evtenc ! filesink location=ball.raw
  for ending in dat es npy npz csv aedat4 hdf5 h5; do try event-convert ball.raw ball.$ending; done
  for ending in raw dat es npy npz csv aedat4 hdf5 h5; do try gst-play-1.0 --no-interactive --videosink=fakesink ball.$ending; done
  try event-calibrate --version
  try event-realism --version
  try event-dataset --version
  for program in event-convert event-info event-dataset event-thumbnail web-events rtsp-events virtual-camera; do try man --whatis $program; done
  try test -s /usr/share/doc/gsteventcamera-1.0/struct.Info.html
  try pkg-config --exists --print-errors gsteventcamera-1.0
  try cc /usr/share/doc/libgsteventcamera-1.0-dev/examples/count_events.c -o count_events $(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0)
  try ./count_events "videotestsrc pattern=ball num-buffers=10 ! eventsim-diff ! appsink name=events"
  try python3 -c 'import gi; gi.require_version("GstEventCamera", "1.0"); from gi.repository import Gst, GstEventCamera; Gst.init(None); print(GstEventCamera.Info)'
  try python3 -c 'import gst_eventcamera as ec; events = ec.read("ball.raw"); assert ec.voxel_grid(events).any(); ec.write("again.npz", events)'
  for file in ball.raw=application/x-prophesee-raw ball.h5=application/x-event-hdf5; do
    [ "$(gio info -a standard::content-type "${file%=*}" | sed -n 's/.*content-type: //p')" = "${file#*=}" ]
  done
  gio mime application/x-es | grep -q events-in-gnome-videos.desktop
  try event-thumbnail --size=128 ball.h5 thumbnail.png
}
apt-get update -q
apt-get install -q -y --no-install-recommends gcc libc6-dev man-db pkg-config gstreamer1.0-tools gstreamer1.0-plugins-base-apps \
  libglib2.0-bin libgstreamer-plugins-base1.0-dev desktop-file-utils shared-mime-info totem libgl1-mesa-dri \
  python3-gi python3-numpy
# What the packages need, without them.
for package in /tmp/old/*.deb; do
  dpkg-deb -f "$package" Depends | tr ',' '\n' | sed 's/[(|:].*//; s/ //g'
done | sort -u | grep -v -e eventcam -e eventsim | xargs apt-get install -q -y --no-install-recommends
files >/tmp/before
echo "Installing"
apt-get install -q -y --no-install-recommends /tmp/old/*.deb
used
echo "Upgrading"
apt-get install -q -y --no-install-recommends /tmp/new/*.deb
used
echo "Removing"
for package in /tmp/old/*.deb; do dpkg-deb -f "$package" Package; done | xargs apt-get purge -q -y
files >/tmp/after
diff /tmp/before /tmp/after
echo "The packages were installed, used, upgraded and removed"
USE

mkdir "$scratch/old"
cp "$packages"/*.deb "$scratch/old/"
rm -f "$scratch"/old/*-dbgsym_*
tests/mmdebstrap.sh host --variant=apt --format=null \
  --customize-hook="copy-in '$scratch/old' '$scratch/new' '$scratch/use' /tmp" \
  --customize-hook='chroot "$1" bash /tmp/use'

# Runs in another chroot: what a new user does. Of the checkout, it has the pages and how to run their lines.
cat >"$scratch/read" <<'READ'
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive
apt-get update -q
mkdir /tmp/old/gst-eventsim
cd /tmp/old/gst-eventsim
# By default apt installs what is recommended, but not where mmdebstrap calls it.
install=$(sed -n 's/^apt install /apt-get install -q -y --install-recommends /p' /tmp/pages/README.md)
eval "${install:?}"
source /tmp/pages/scratch_folder.sh
source /tmp/pages/run_lines.sh
mkdir -p pipelines/examples
ln -s /usr/share/doc/{gir1.2-gsteventcamera-1.0,python3-gst-eventcamera}/examples/* pipelines/examples/
eval "gst-launch-1.0 -q $ball ! x264enc ! mp4mux ! filesink location=drive.mp4"
run_lines /tmp/pages/README.md /tmp/pages/api.md /tmp/pages/network.md
for file in ball.npz out.raw out.h5 events.npy; do
  [ -s $file ] || fail "$file is missing or empty"
done
./pipelines/examples/on_and_off.py
echo "The $count lines of the README and of two more pages were run"
READ
mkdir "$scratch/pages"
cp README.md docs/api.md docs/network.md tests/pipelines/scratch_folder.sh tests/pipelines/run_lines.sh "$scratch/pages/"
tests/mmdebstrap.sh host --variant=apt --format=null \
  --customize-hook="copy-in '$scratch/old' '$scratch/pages' '$scratch/read' /tmp" \
  --customize-hook='chroot "$1" bash /tmp/read'
