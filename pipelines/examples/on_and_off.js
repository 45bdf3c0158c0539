#!/usr/bin/gjs -m
// SPDX-License-Identifier: LGPL-2.1-or-later
// Counts ON and OFF events; the same in C, Python and JavaScript. Debian: gjs
// gir1.2-gsteventcamera-1.0 gir1.2-gst-plugins-base-1.0
import Gst from 'gi://Gst?version=1.0';
import 'gi://GstApp?version=1.0';
import GstEventCamera from 'gi://GstEventCamera?version=1.0';
import {exit} from 'system';

Gst.init(null);
const pipeline = Gst.parse_launch(
    'videotestsrc pattern=ball num-buffers=40 ! eventsim-dvs ! appsink name=events sync=false');
const sink = pipeline.get_by_name('events');
pipeline.set_state(Gst.State.PLAYING);
let on = 0, events = 0, sample;
while ((sample = sink.pull_sample())) {
    const [isEvents, info] = GstEventCamera.Info.from_caps(sample.get_caps());
    if (!isEvents) {
        printerr('The appsink receives no events; insert a simulator or a reader: ! eventsim-dvs ! appsink');
        exit(1);
    }
    if (events === 0)
        print(`Events of a ${info.width}x${info.height} sensor`);
    const buffer = sample.get_buffer();
    const bytes = buffer.extract_dup(0, buffer.get_size());
    const words = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let at = 0; at < words.byteLength; at += 8) {
        on += words.getUint16(at + 6, true) >> 15; // time: getUint32(at, true) microseconds after buffer.pts
        ++events;
    }
}
print(`${on} ON, ${events - on} OFF`);
pipeline.set_state(Gst.State.NULL);
