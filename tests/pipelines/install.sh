#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The installation is complete: plugins, programs, library, header, pkg-config file and GIR. Builds
# the C example against it, as an application would.
set -eu
if [ ! -w "$BUILD" ]; then
  echo "$BUILD is read-only: meson cannot install from it"
  exit 77
fi
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
meson install -C "$BUILD" --no-rebuild --destdir "$root" --quiet
(cd "$root" && find . -type f -o -type l | sort)

library=$(dirname "$(find "$root" -name libgsteventcamera-1.0.so)")
plugins=$library/gstreamer-1.0
# Debian's GStreamer searches for plugins here.
[ "${plugins#"$root"}" = "$(pkg-config --variable=pluginsdir gstreamer-1.0)" ]

# As if the root were /. pkg-config expects and prints escaped blanks.
sed -i "s#^prefix=.*#prefix=${root// /\\\\ }/usr#" "$library/pkgconfig/gsteventcamera-1.0.pc"
export PKG_CONFIG_PATH=$library/pkgconfig
declare -a flags
eval "flags=($(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0))"
cc -Wall -Werror -o "$root/count_events" "$SOURCE/pipelines/count_events.c" "${flags[@]}"

export LD_LIBRARY_PATH=$library GST_PLUGIN_PATH=$plugins GST_REGISTRY=$root/registry.bin
for program in event-convert event-calibrate; do
  "$root/usr/bin/$program" --help >"$root/help"
  grep -qi "^usage" "$root/help"
done
"$root/count_events" "videotestsrc num-buffers=5 pattern=ball ! eventsim-frame ! appsink name=events"
