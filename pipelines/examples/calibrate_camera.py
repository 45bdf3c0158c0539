#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Calibrates an event camera with a recording of a chessboard that moves: calibrate_camera.py board.raw camera.xml

Needs gstreamer1.0-opencv. `eventundistort location=camera.xml` undoes the distortion that was found."""
import sys

import gi

gi.require_version("Gst", "1.0")
from gi.repository import Gst  # noqa: E402

Gst.init(None)
# A board has one inner corner less than squares in each direction; five pictures a second differ enough.
pipeline = Gst.parse_launch(
    "filesrc name=file ! decodebin caps=application/x-event-camera ! eventreconstruct ! video/x-raw,framerate=5/1 ! "
    "videoconvert ! cameracalibrate name=calibrate board-width=9 board-height=6 frame-count=20 delay=0 ! fakesink")
pipeline.get_by_name("file").props.location = sys.argv[1]
pipeline.set_state(Gst.State.PLAYING)
message = pipeline.get_bus().timed_pop_filtered(Gst.CLOCK_TIME_NONE, Gst.MessageType.EOS | Gst.MessageType.ERROR)
settings = pipeline.get_by_name("calibrate").props.settings
pipeline.set_state(Gst.State.NULL)
if message.type == Gst.MessageType.ERROR:
    sys.exit(message.parse_error()[0].message)
if not settings:
    sys.exit("The board was found in less than 20 pictures.")
with open(sys.argv[2], "w", encoding="utf-8") as file:
    file.write(settings)
