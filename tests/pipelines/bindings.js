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

// Events: a time in 64 bits, x and y in 16, the polarity, three bytes that are not used.
const packed = Gst.Buffer.new_wrapped(new Uint8Array([5, 0, 0, 0, 1, 0, 2, 128]));
packed.pts = 7999;
const event = new DataView(GstEventCamera.unpack(packed).toArray().buffer);
check('event', [event.getInt32(0, true), event.getUint16(8, true), event.getUint16(10, true), event.getUint8(12)],
    [12, 1, 2, 1]);

// Triggers and IMU samples.
const triggers = Array.from({length: 32}, (_, i) => i);
const sent = GstEventCamera.event_new_event_camera_triggers(new GLib.Bytes(triggers));
check('triggers', Array.from(GstEventCamera.event_get_event_camera_triggers(sent).toArray()), triggers);
check('no samples', GstEventCamera.event_get_event_camera_imu_samples(sent), null);
const samples = Array.from({length: 48}, (_, i) => i);
const sentSamples = GstEventCamera.event_new_event_camera_imu_samples(new GLib.Bytes(samples));
check('samples', Array.from(GstEventCamera.event_get_event_camera_imu_samples(sentSamples).toArray()), samples);
