#!/usr/bin/gjs -m
// SPDX-License-Identifier: LGPL-2.1-or-later
// The C API in JavaScript, as bindings.py.
import GLib from 'gi://GLib';
import Gst from 'gi://Gst?version=1.0';
import GstEventCamera from 'gi://GstEventCamera?version=1.0';
import {exit} from 'system';

function check(what, actual, expected) {
    if (JSON.stringify(actual) === JSON.stringify(expected))
        return;
    printerr(`${what}: ${JSON.stringify(actual)} instead of ${JSON.stringify(expected)}`);
    exit(1);
}

Gst.init(null);

// Labels: a class in 16 bits, a cause, a reserved byte.
const labels = [0, 0, 0, 0, 44, 1, GstEventCamera.Cause.LEAK, 0];
const buffer = Gst.Buffer.new_wrapped(new Uint8Array(2 * 8));
check('no labels', GstEventCamera.buffer_get_event_camera_label_meta(buffer), null);
GstEventCamera.buffer_add_event_camera_label_bytes(buffer, new GLib.Bytes(labels));
const labelMeta = GstEventCamera.buffer_get_event_camera_label_meta(buffer);
check('labels', Array.from(labelMeta.get_bytes().toArray()), labels);

// Flow: x and y of each pixel.
const flow = Float32Array.from({length: 24}, (_, i) => i);
const frame = Gst.Buffer.new_wrapped(new Uint8Array(12));
check('no flow', GstEventCamera.buffer_get_event_camera_flow_meta(frame), null);
GstEventCamera.buffer_add_event_camera_flow_meta(frame, 4, 3, new GLib.Bytes(new Uint8Array(flow.buffer)));
const flowMeta = GstEventCamera.buffer_get_event_camera_flow_meta(frame);
check('size', [flowMeta.width, flowMeta.height], [4, 3]);
check('flow', Array.from(new Float32Array(flowMeta.get_flow().toArray().buffer)), Array.from(flow));
