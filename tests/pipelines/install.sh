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

# Each file is in exactly one Debian package.
while IFS= read -r file; do
  packages=()
  for list in "$SOURCE"/debian/*.install; do
    while IFS= read -r pattern; do
      # shellcheck disable=SC2053
      if [[ $file == $pattern || $file == $pattern/* ]]; then packages+=("${list##*/}"); fi
    done <"$list"
  done
  [ ${#packages[@]} -eq 1 ] || {
    echo "FAILED: $file is in these packages: ${packages[*]}"
    exit 1
  }
done < <(cd "$root" && find * -type f -o -type l)

library=$(dirname "$(find "$root" -name libgsteventcamera-1.0.so)")
plugins=$library/gstreamer-1.0
# Debian's GStreamer searches for plugins here.
[ "${plugins#"$root"}" = "$(pkg-config --variable=pluginsdir gstreamer-1.0)" ]

# The interface of the library is the one that packages rely on. dpkg-gensymbols
# reports lost symbols only for a version later than theirs.
mkdir -p "$root/debian/package/DEBIAN"
cp "$SOURCE/debian/control" "$SOURCE/debian/changelog" "$root/debian/"
(cd "$root" && dpkg-gensymbols -c4 -v999 -plibgsteventcamera-1.0-0 -Pdebian/package -Odebian/symbols \
  -I"$SOURCE/debian/libgsteventcamera-1.0-0.symbols" -e"$library"/libgsteventcamera-1.0.so.0)

# Its documentation tells which version introduced what.
gir=$(find "$root" -name 'GstEventCamera-1.0.gir')
/usr/bin/python3 - "$gir" <<'PYTHON'
import sys
from xml.etree import ElementTree

core = "{http://www.gtk.org/introspection/core/1.0}"
public = {core + tag for tag in ("constant", "enumeration", "function", "function-inline", "method", "method-inline", "record")}
new = [e.get("name") for e in ElementTree.parse(sys.argv[1]).iter() if e.tag in public and "version" not in e.attrib]
assert not new, f"no Since: in the documentation of {new}"
PYTHON
gi-docgen generate --quiet --fatal-warnings --no-namespace-dir --config="$SOURCE/gst/eventcamera/documentation.toml" \
  --output-dir="$root/documentation" "$gir"
grep -q "One event of a buffer" "$root/documentation/struct.Event.html"

# As if the root were /. pkg-config expects and prints escaped blanks.
sed -i "s#^prefix=.*#prefix=${root// /\\\\ }/usr#" "$library/pkgconfig/gsteventcamera-1.0.pc"
export PKG_CONFIG_PATH=$library/pkgconfig
declare -a flags
eval "flags=($(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0))"
cc -Wall -Werror -o "$root/count_events" "$SOURCE/pipelines/examples/count_events.c" "${flags[@]}"

export LD_LIBRARY_PATH=$library GST_PLUGIN_PATH=$plugins GST_REGISTRY=$root/registry.bin
export PATH=$root/usr/bin:$PATH
completed() { # PROGRAM WORD...
  (
    source "$root/usr/share/bash-completion/completions/$1"
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
    "$(complete -p "$1" | sed 's/.*-F \([^ ]*\) .*/\1/')" "$1"
    printf '%s\n' "${COMPREPLY[@]}"
  )
}
for program in event-convert event-info event-thumbnail event-calibrate event-dataset event-realism web-events rtsp-events virtual-camera; do
  "$root/usr/bin/$program" --help >"$root/help"
  grep -qi "^usage" "$root/help"
  [[ $(GST_PLUGIN_PATH= GST_REGISTRY=$root/none.bin "$root/usr/bin/$program" --version) =~ ^$program\ [0-9]+\.[0-9]+\.[0-9]+$ ]]
  # Its manual describes each option, and bash completes each.
  sed 's/\\-/-/g' "$root/usr/share/man/man1/$program.1" >"$root/manual"
  options=$(grep -o -e ' --[a-z-]*' "$root/help" | sort -u)
  for option in $options; do
    grep -q -e "$option" "$root/manual"
    completed "$program" "$option" | grep -qx -e "$option"
  done
done
completed event-convert --format EVT21 | grep -qx EVT21
completed event-convert --compression = zstd-h | grep -qx zstd-high
completed event-convert -f v | grep -qx v2e
completed event-convert --extension = h | grep -qx hdf5
completed event-convert --output-directory "$root/us" | grep -qx "$root/usr"
# Its manual lists the formats.
for format in $("$root/usr/bin/event-convert" --help | sed -n 's/^  --format, .raw: //p'); do
  grep -qF "$format" "$root/usr/share/man/man1/event-convert.1"
done
completed event-calibrate --element eventsim-de | grep -qx eventsim-dense
completed rtsp-events --simulator eventsim-de | grep -qx eventsim-dense
touch "$root/camera0"
completed web-events --device "$root/cam" | grep -qx "$root/camera0"
# The servers find what they are made of, such as the page.
for program in web-events rtsp-events; do
  : >"$root/served"
  "$root/usr/bin/$program" --port 0 >"$root/served" &
  trap 'kill $! 2>/dev/null || true; rm -rf "$root"' EXIT
  for _ in $(seq 300); do
    if grep -q "until Ctrl-C" "$root/served"; then break; fi
    sleep 0.1
  done
  if [ $program = web-events ]; then
    /usr/bin/python3 -c 'import sys, urllib.request; assert b"<html" in urllib.request.urlopen(sys.argv[1]).read()' \
      "$(grep -o 'http://[^ ]*' "$root/served")"
  fi
  kill $!
  wait $!
done
"$root/count_events" "videotestsrc num-buffers=5 pattern=ball ! eventsim-frame ! appsink name=events"
