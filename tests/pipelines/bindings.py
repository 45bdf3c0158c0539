#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The C API in Python. bindings.js does the same in JavaScript."""

import os
import struct
import sys
import unittest

if not os.path.exists(os.path.join(os.environ["GI_TYPELIB_PATH"], "GstEventCamera-1.0.typelib")):
    print("built without introspection: no Python")
    sys.exit(77)

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


if __name__ == "__main__":
    unittest.main()
