#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Offers the events of a webcam as a camera, drawn as video, until Ctrl-C. Applications that find cameras through
PipeWire list it as "Event camera".

    virtual-camera --device /dev/video0 --simulator "eventsim-sparse palette=light" """
import os
import stat
import sys

try:
    import gi

    gi.require_version("Gst", "1.0")
    from gi.repository import Gst
except (ImportError, ValueError) as missing:
    sys.exit(f"error: {missing}\nOn Debian, install: python3-gi gir1.2-gstreamer-1.0")

from capture import CAMERA, SCENE, add_simulator  # noqa: E402
from program import find_elements, find_plugins, option_parser, run  # noqa: E402

# pipewiresink 0.3.65 offers buffers without memory if the allocation query reaches it, and crashes if an application
# connects before the first picture. It lists the camera when caps arrive; funnel delays them until the first picture.
# A leaky queue would reset the simulator, with an empty picture, at each dropped frame.
OUTPUT = ["videoconvert", "!", "video/x-raw,format=YUY2", "!", "identity", "drop-allocation=true", "!", "funnel", "!",
          "pipewiresink", "sync=false", "mode=provide", "client-name=event-camera",
          "stream-properties=p,media.class=Video/Source,media.role=Camera,node.name=event-camera,"
          'node.description="Event\\ camera"']


def main():
    parser = option_parser(__doc__, prog="virtual-camera")
    parser.add_argument("--device", help="camera, such as /dev/video0 (default: a test scene)")
    add_simulator(parser)
    args = parser.parse_args()
    Gst.init(None)
    find_plugins(["eventsim"])
    find_elements(["pipewiresink"], "gstreamer1.0-pipewire")
    camera = SCENE.split()
    if args.device:
        if not os.path.exists(args.device):
            raise RuntimeError(f"there is no camera {args.device}; list those that are there: ls /dev/video*")
        camera = CAMERA.split()
        camera.insert(1, f"device={args.device}")
    simulator = args.simulator.split()
    if not simulator or not Gst.ElementFactory.find(simulator[0]):
        raise RuntimeError(f'no simulator "{args.simulator}"; list them: gst-inspect-1.0 eventsim')
    folder = (os.environ.get("PIPEWIRE_RUNTIME_DIR") or os.environ.get("XDG_RUNTIME_DIR")
              or f"/run/user/{os.getuid()}")
    remote = os.path.join(folder, os.environ.get("PIPEWIRE_REMOTE") or "pipewire-0")
    if not os.path.exists(remote) or not stat.S_ISSOCK(os.stat(remote).st_mode):
        raise RuntimeError(f"PipeWire is not running, since there is no {remote}; start it: systemctl --user start pipewire")
    print('Offering the camera "Event camera" to PipeWire until Ctrl-C', flush=True)
    os.execvp("gst-launch-1.0", ["gst-launch-1.0", "-q", *camera, "!", "queue", "max-size-buffers=2", "!", *simulator,
                                 "!", *OUTPUT])


if __name__ == "__main__":
    run(main)
