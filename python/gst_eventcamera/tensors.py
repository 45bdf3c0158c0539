# SPDX-License-Identifier: LGPL-2.1-or-later
"""Events as tensors, computed by the core of the element eventtensor."""
from __future__ import annotations

import ctypes
from typing import Iterator

import numpy as np
from numpy.ctypeslib import ndpointer

from .events import EVENT, packed_events
from .pipeline import Gst, GstEventCamera, Pipeline, given_size
from .sources import SINK

TENSOR_CAPS = "other/tensors,format=(string)static,num_tensors=1"

# PyGObject would copy the arrays.
_voxel_grid = ctypes.CDLL("libgsteventcamera-1.0.so.0").gst_event_camera_voxel_grid
_voxel_grid.argtypes = [ndpointer(EVENT, ndim=1, flags="C"), ctypes.c_size_t, ctypes.c_uint, ctypes.c_uint, ctypes.c_uint,
                        ndpointer(np.float32, ndim=3, flags=("C", "W"))]


def voxel_grid(events: np.ndarray, bins: int = 5, width: int = 0, height: int = 0) -> np.ndarray:
    """The voxel grid of events: each adds its polarity, +1 or -1, to the two nearest of `bins` instants, from
    the time of the first event to the time of the last, in proportion to their closeness.

    events: an array with the fields t, x, y and p, sorted by t; shape (events,).
    bins: 1 to 256.
    width, height: of the sensor, in pixels, 1 to 16384; may be omitted for Events of a known sensor.

    Returns float32 of shape (bins, height, width), equal to the tensor of eventtensor for a window of these
    events. Raises ValueError for events that are not sorted or outside the sensor, and for fields that are not whole
    numbers."""
    width, height = given_size(events, width, height)
    if not isinstance(bins, (int, np.integer)) or not 1 <= bins <= GstEventCamera.MAX_BINS:
        raise ValueError(f"no voxel grid of {bins} bins; give 1 to {GstEventCamera.MAX_BINS}")
    packed = packed_events(events)
    grid = np.empty((bins, height, width), np.float32)
    if not _voxel_grid(packed, len(packed), width, height, bins, grid):
        raise ValueError(f"events are not sorted by time or outside the sensor of {width}x{height} pixels")
    return grid


def tensors(pipeline: str) -> Iterator[np.ndarray]:
    """Yields the tensors at the end of a pipeline, such as
    "filesrc location=recording.raw ! evtdec ! eventtensor representation=histogram accumulation-time=50000000".

    Arrays of shape (channels, height, width), of type float32, float16 or uint8. Raises PipelineError."""
    with Pipeline(f"{pipeline} ! {TENSOR_CAPS} ! {SINK}") as running:
        for sample in running.samples():
            yield tensor_of(sample)


def tensor_of(sample: Gst.Sample) -> np.ndarray:
    fields = sample.get_caps().get_structure(0)
    shape = [int(side) for side in fields.get_string("dimensions").split(":")]
    buffer: Gst.Buffer = sample.get_buffer()
    values = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), fields.get_string("types"))
    return values.reshape(shape[2::-1])
