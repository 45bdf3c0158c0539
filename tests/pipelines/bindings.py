#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The C API in Python."""
import struct
import unittest

import scratch  # noqa: F401  first
import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstEventCamera", "1.0")
from gi.repository import GLib, Gst, GstEventCamera  # noqa: E402

Gst.init(None)


class Metas(unittest.TestCase):
    def test_labels(self):
        buffer = Gst.Buffer.new_wrapped(bytes(2 * 8))
        self.assertIsNone(GstEventCamera.buffer_get_event_camera_label_meta(buffer))
        labels = [GstEventCamera.Label(), GstEventCamera.Label()]
        labels[1].object_class, labels[1].cause = 300, GstEventCamera.Cause.LEAK
        self.assertEqual(GstEventCamera.buffer_add_event_camera_label_meta(buffer, labels).n_labels, 2)
        part = buffer.copy_region(Gst.BufferCopyFlags.META | Gst.BufferCopyFlags.MEMORY, 8, 8)
        read = GstEventCamera.buffer_get_event_camera_label_meta(part).get_bytes().get_data()
        self.assertEqual(list(struct.iter_unpack("<HBB", read)), [(300, 2, 0)])

    def test_flow(self):
        flow = np.arange(24, dtype=np.float32).reshape(3, 4, 2)
        frame = Gst.Buffer.new_wrapped(bytes(12))
        self.assertIsNone(GstEventCamera.buffer_get_event_camera_flow_meta(frame))
        GstEventCamera.buffer_add_event_camera_flow_meta(frame, 4, 3, GLib.Bytes.new(flow.tobytes()))
        copy = frame.copy()
        del frame
        meta = GstEventCamera.buffer_get_event_camera_flow_meta(copy)
        self.assertEqual((meta.width, meta.height), (4, 3))
        read = np.frombuffer(meta.get_flow().get_data(), np.float32)
        del meta, copy
        self.assertTrue(np.array_equal(read.reshape(3, 4, 2), flow))

    def test_arrays_that_only_c_can_index(self):
        buffer = Gst.Buffer.new_wrapped(struct.pack("<IHHIHH", 5, 1, 2, 6, 3, 4))
        labels = GstEventCamera.buffer_add_event_camera_label_bytes(buffer, GLib.Bytes.new(bytes([7, *7 * [0]])))
        buffer.pts = 0
        mapped, events = GstEventCamera.map(buffer)
        self.assertTrue(mapped)
        self.assertEqual((events.n_events, labels.n_labels), (2, 2))
        self.assertEqual((events.events.x, labels.labels.object_class), (1, 7))  # the first
        GstEventCamera.unmap(events)


class Events(unittest.TestCase):
    def test_unpack(self):
        buffer = Gst.Buffer.new_wrapped(struct.pack("<IHHIHH", 5, 1, 2, 6, 3, 0x8004))
        self.assertIsNone(GstEventCamera.unpack(buffer))  # no time
        buffer.pts = 7_999
        events = list(struct.iter_unpack("<qHHB3x", GstEventCamera.unpack(buffer).get_data()))
        self.assertEqual(events, [(12, 1, 2, 0), (13, 3, 4, 1)])
        self.assertIsNone(GstEventCamera.unpack(Gst.Buffer.new_wrapped(bytes(9))))


class SensorData(unittest.TestCase):
    def test_triggers(self):
        records = struct.pack("<qIIqII", 1, 2, 1, 3, 4, 0)
        event = GstEventCamera.event_new_event_camera_triggers(GLib.Bytes.new(records))
        self.assertEqual(event.type, Gst.EventType.CUSTOM_DOWNSTREAM)
        self.assertEqual(GstEventCamera.event_get_event_camera_triggers(event).get_data(), records)
        self.assertIsNone(GstEventCamera.event_get_event_camera_imu_samples(event))
        self.assertIsNone(GstEventCamera.event_get_event_camera_triggers(Gst.Event.new_eos()))

    def test_imu_samples(self):
        records = struct.pack("<q10f", 1, 20, *range(9))
        event = GstEventCamera.event_new_event_camera_imu_samples(GLib.Bytes.new(records))
        self.assertEqual(GstEventCamera.event_get_event_camera_imu_samples(event).get_data(), records)
        self.assertIsNone(GstEventCamera.event_get_event_camera_triggers(event))


if __name__ == "__main__":
    unittest.main()
