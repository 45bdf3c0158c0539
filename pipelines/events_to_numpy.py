#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Example of reading events in Python: runs a pipeline and collects the events that reach its
appsink in a NumPy array, one row (t, x, y, p) per event, t in microseconds.

    events_to_numpy.py "videotestsrc num-buffers=90 ! eventsim-diff ! appsink name=events" out.npy

Needs the system's Python with PyGObject and NumPy.
"""
import sys

try:
    import gi
    import numpy as np

    gi.require_version("Gst", "1.0")
    gi.require_version("GstApp", "1.0")
    gi.require_version("GstEventCamera", "1.0")
    from gi.repository import GLib, Gst, GstApp, GstEventCamera
except (ImportError, ValueError) as missing:
    sys.exit(f"error: {missing}\nOn Debian, install: python3-gi python3-numpy gir1.2-gstreamer-1.0"
             " gir1.2-gst-plugins-base-1.0 gir1.2-gsteventcamera-1.0")

XYTP = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])
EVENT = np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")])


def events_of(buffer):
    """The events of a buffer, with 64-bit times."""
    packed = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), XYTP)
    events = np.empty(len(packed), EVENT)
    events["t"] = buffer.pts // 1000 + packed["t"].astype("<i8")
    events["x"] = packed["x"]
    events["y"] = packed["y_p"] & 0x7FFF
    events["p"] = packed["y_p"] >> 15
    return events


def sink_of(pipeline):
    sink = pipeline.get_by_name("events") if isinstance(pipeline, Gst.Bin) else None
    if not isinstance(sink, GstApp.AppSink):
        raise RuntimeError("The pipeline has no appsink name=events; end it in: ! appsink name=events")
    return sink


def size_of(caps):
    """The size of the sensor."""
    is_events, info = GstEventCamera.Info.from_caps(caps)
    if not is_events:
        raise RuntimeError(f"The appsink receives {caps.get_structure(0).get_name()}, not events. Insert a"
                           " simulator (! eventsim-diff ! appsink name=events) or, for an event file, use:"
                           ' decodebin caps="application/x-event-camera,format=XYTP" expose-all-streams=false'
                           " ! appsink name=events")
    return info.width, info.height


def samples(launch):
    """Runs a pipeline and yields the samples that reach its appsink."""
    Gst.init(None)
    pipeline = Gst.parse_launch(launch)
    try:
        sink = sink_of(pipeline)
        pipeline.set_state(Gst.State.PLAYING)
        while not sink.is_eos():
            if sample := sink.try_pull_sample(Gst.SECOND // 10):
                yield sample
            elif message := pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR):
                error, cause = message.parse_error()
                raise RuntimeError(f"{message.src.get_name()}: {error.message} {cause.splitlines()[-1]}")
    finally:
        pipeline.set_state(Gst.State.NULL)


def main(launch, path=None):
    size = None
    parts = [np.empty(0, EVENT)]
    for sample in samples(launch):
        if size != (size := size_of(sample.get_caps())):
            print(f"Events of a {size[0]}x{size[1]} sensor")
        parts.append(events_of(sample.get_buffer()))
    events = np.concatenate(parts)
    print(f"{len(events)} events, {np.count_nonzero(events['p'])} ON")
    if path:
        np.save(path, events)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(f"usage: {sys.argv[0]} PIPELINE [FILE.npy]")
    try:
        main(*sys.argv[1:])
    except (RuntimeError, OSError, GLib.Error) as failure:
        sys.exit(f"error: {failure}")
