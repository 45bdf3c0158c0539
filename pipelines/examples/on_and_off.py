#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts ON and OFF events; the same in C, Python and JavaScript. Debian: python3-gi
gir1.2-gsteventcamera-1.0 gir1.2-gst-plugins-base-1.0"""
import struct
import sys

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
gi.require_version("GstEventCamera", "1.0")
from gi.repository import Gst, GstApp, GstEventCamera  # noqa: E402, F401

Gst.init(None)
pipeline = Gst.parse_launch(
    "videotestsrc pattern=ball num-buffers=40 ! eventsim-dvs ! appsink name=events sync=false")
sink = pipeline.get_by_name("events")
pipeline.set_state(Gst.State.PLAYING)
on = events = 0
while sample := sink.pull_sample():
    is_events, info = GstEventCamera.Info.from_caps(sample.get_caps())
    if not is_events:
        sys.exit("The appsink receives no events; insert a simulator or a reader: ! eventsim-dvs ! appsink")
    if events == 0:
        print(f"Events of a {info.width}x{info.height} sensor")
    buffer = sample.get_buffer()
    for t, x, y_p in struct.iter_unpack("<IHH", buffer.extract_dup(0, buffer.get_size())):
        on += y_p >> 15  # t: microseconds after buffer.pts; y: y_p & 0x7fff
        events += 1
print(f"{on} ON, {events - on} OFF")
pipeline.set_state(Gst.State.NULL)
