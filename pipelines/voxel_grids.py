#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Example of a loop over event tensors: runs a pipeline and makes a voxel grid of each buffer that
reaches its appsink. A buffer holds the events of an interval, buffer-duration of the reader.

    voxel_grids.py "filesrc location=recording.raw ! evtdec buffer-duration=50000000 ! appsink name=events"

Needs what events_to_numpy.py needs.
"""
import sys

from events_to_numpy import GLib, events_of, np, samples, size_of

BINS = 5


def voxel_grid(events, start, duration, size):
    """The polarities (+1, -1) of events, shared out to the two nearest of BINS instants from `start` to
    `start + duration`, in microseconds (Zhu et al., CVPR 2019). Shape (BINS, height, width)."""
    width, height = size
    grid = np.zeros((BINS, height, width), np.float32)
    at = (events["t"] - start) * ((BINS - 1) / duration)
    before = np.clip(at.astype(int), 0, BINS - 2)
    polarity = np.where(events["p"], 1, -1)
    np.add.at(grid, (before, events["y"], events["x"]), polarity * (1 - (at - before)))
    np.add.at(grid, (before + 1, events["y"], events["x"]), polarity * (at - before))
    return grid


def main(launch):
    for sample in samples(launch):
        buffer = sample.get_buffer()
        start, duration = buffer.pts // 1000, buffer.duration // 1000
        events = events_of(buffer)
        grid = voxel_grid(events, start, duration, size_of(sample.get_caps()))
        # A network would be fed here.
        print(f"{start / 1e6:.3f} s: {len(events)} events, grid {grid.shape}, sum {grid.sum():.0f}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} PIPELINE")
    try:
        main(sys.argv[1])
    except (RuntimeError, OSError, GLib.Error) as failure:
        sys.exit(f"error: {failure}")
