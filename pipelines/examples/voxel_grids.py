#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes a voxel grid of every 50 ms of a recording: voxel_grids.py recording.raw"""
import sys

import gst_eventcamera as ec

for chunk in ec.stream(sys.argv[1], window=0.05):
    grid = ec.voxel_grid(chunk, bins=5)  # a network would be fed with it
    print(f"{chunk.start:.3f} s: {len(chunk)} events, grid {grid.shape}, sum {grid.sum():.0f}")
