#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Collects the events at the end of a pipeline in a NumPy file with the fields t (microseconds), x, y and p:

    events_to_numpy.py "videotestsrc pattern=ball num-buffers=90 ! eventsim-dvs" out.npy
"""
import sys

import gst_eventcamera as ec
import numpy as np

try:
    events = ec.join(ec.live(sys.argv[1]))
    print(f"{len(events)} events of a {events.width}x{events.height} sensor, {events['p'].sum()} ON")
    np.save(sys.argv[2], events)
except (ec.PipelineError, OSError) as failure:
    sys.exit(f"error: {failure}")
