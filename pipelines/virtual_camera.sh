#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
set -eu
usage() {
  cat <<'USAGE'
usage: virtual-camera [--help] [--version] [--device DEVICE] [--simulator SIMULATOR]

Offers the events of a webcam as a camera, drawn as video, until Ctrl-C. Applications that find cameras through
PipeWire list it as "Event camera".

    virtual-camera --device /dev/video0 --simulator "eventsim-sparse palette=light"

options:
  --help                 show this message and exit
  --version              print the version and exit
  --device DEVICE        camera, such as /dev/video0 (default: a test scene)
  --simulator SIMULATOR  simulator and its properties (default: eventsim-dvs)
USAGE
}
simulator=(eventsim-dvs)
camera=(videotestsrc is-live=true pattern=ball)
while [ $# -gt 0 ]; do
  case $1 in
    --help)
      usage
      exit
      ;;
    --version)
      echo "virtual-camera @VERSION@"
      exit
      ;;
    --device | --simulator)
      if [ $# -lt 2 ]; then
        usage >&2
        exit 2
      fi
      if [ "$1" = --simulator ]; then
        read -ra simulator <<<"$2"
      else
        if [ ! -e "$2" ]; then
          echo "error: there is no camera $2; list those that are there: ls /dev/video*" >&2
          exit 1
        fi
        # The default of v4l2src is the largest frame size, which many cameras deliver only a few times a second.
        camera=(v4l2src device="$2" !
          "video/x-raw,width=[1,640],height=[1,480];image/jpeg,width=[1,640],height=[1,480]" ! decodebin)
      fi
      shift 2
      ;;
    *)
      usage >&2
      exit 2
      ;;
  esac
done

has() { # ELEMENT, from a plugin of any version
  gst-inspect-1.0 --exists --atleast-version=0.0 "$1"
}
if ! has eventsim-dvs; then
  echo "error: GStreamer does not find the plugin eventsim. In a checkout, enter the development shell:" \
    "meson devenv -C build -w ." >&2
  echo "Otherwise install it: the Debian package gstreamer1.0-eventsim, or as root: meson install -C build" >&2
  exit 1
fi
if ! has pipewiresink; then
  echo "error: GStreamer has no pipewiresink; on Debian, install: gstreamer1.0-pipewire" >&2
  exit 1
fi
if ! has "${simulator[0]-}"; then
  echo "error: no simulator \"${simulator[*]}\"; list them: gst-inspect-1.0 eventsim" >&2
  exit 1
fi
if [[ ${simulator[0]} =~ ^(gl)?eventsim- ]]; then # skips frames that a camera repeats
  simulator=("${simulator[0]}" skip-repeated=true "${simulator[@]:1}")
fi
remote=${PIPEWIRE_REMOTE:-pipewire-0}
if [[ $remote != /* ]]; then remote=${PIPEWIRE_RUNTIME_DIR:-${XDG_RUNTIME_DIR:-/run/user/$(id -u)}}/$remote; fi
if [ ! -S "$remote" ]; then
  echo "error: PipeWire is not running, since there is no $remote; start it: systemctl --user start pipewire" >&2
  exit 1
fi
echo "Offering the camera \"Event camera\" to PipeWire until Ctrl-C"
# pipewiresink 0.3.65 offers buffers without memory if the allocation query reaches it, and crashes if an application
# connects before the first picture. It lists the camera when caps arrive; funnel delays them until the first picture.
# A leaky queue would reset the simulator, with an empty picture, at each dropped frame.
exec gst-launch-1.0 -q "${camera[@]}" ! queue max-size-buffers=2 ! "${simulator[@]}" ! videoconvert ! \
  video/x-raw,format=YUY2 ! identity drop-allocation=true ! funnel ! \
  pipewiresink sync=false mode=provide client-name=event-camera \
  stream-properties='p,media.class=Video/Source,media.role=Camera,node.name=event-camera,node.description="Event\ camera"'
