#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Example of reading events in Python: runs a pipeline and collects the events that reach its
appsink in a NumPy array, one row (t, x, y, p) per event, t in microseconds.

    events_to_numpy.py "videotestsrc num-buffers=90 ! eventsim-diff ! appsink name=events" out.npy

Needs the system's Python with PyGObject and NumPy (Debian: python3-gi python3-numpy
gir1.2-gstreamer-1.0 gir1.2-gst-plugins-base-1.0).
"""
import sys

import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
gi.require_version("GstEventCamera", "1.0")
from gi.repository import Gst, GstApp, GstEventCamera  # noqa: E402

XYTP = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])
EVENT = np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")])


def events_of(buffer):
    """The events of a buffer, with times since the start of the stream."""
    packed = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), XYTP)
    events = np.empty(len(packed), EVENT)
    events["t"] = buffer.pts // 1000 + packed["t"].astype("<i8")
    events["x"] = packed["x"]
    events["y"] = packed["y_p"] & 0x7FFF
    events["p"] = packed["y_p"] >> 15
    return events


def main(launch, path=None):
    Gst.init(None)
    pipeline = Gst.parse_launch(launch)
    sink = pipeline.get_by_name("events")
    pipeline.set_state(Gst.State.PLAYING)
    bus = pipeline.get_bus()
    parts = []
    while not sink.is_eos():
        sample = sink.try_pull_sample(Gst.SECOND // 10)
        if not sample:
            if message := bus.pop_filtered(Gst.MessageType.ERROR):
                sys.exit(message.parse_error()[0].message)
            continue
        if not parts:
            _, info = GstEventCamera.Info.from_caps(sample.get_caps())
            print(f"Events of a {info.width}x{info.height} sensor")
        parts.append(events_of(sample.get_buffer()))
    pipeline.set_state(Gst.State.NULL)

    events = np.concatenate(parts) if parts else np.empty(0, EVENT)
    print(f"{len(events)} events, {np.count_nonzero(events['p'])} ON")
    if path:
        np.save(path, events)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(f"usage: {sys.argv[0]} PIPELINE [FILE.npy]")
    main(*sys.argv[1:])
