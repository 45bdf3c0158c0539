# SPDX-License-Identifier: LGPL-2.1-or-later
"""Events of event cameras as NumPy arrays: read, simulated, live, as voxel grids, and written.

    import gst_eventcamera as ec

    events = ec.read("recording.raw")
    for chunk in ec.stream("recording.raw", window=0.033): ...
    for chunk in ec.simulate("drive.mp4", "eventsim-dvs preset=davis346 seed=7"): ...
    for chunk in ec.live("v4l2src ! eventsim-dvs"): ...
    voxels = ec.voxel_grid(chunk, bins=5)
    ec.write("out.aedat4", events, width=346, height=260)
    for video in ec.Dataset("recipe.yaml"): ...

Events are structured arrays with the fields t (int64, microseconds), x, y (uint16) and p (bool, True = ON).
Failures of pipelines are raised as PipelineError with the text of the element that failed. What an element warns
of, such as corrupt data that it skips, is a PipelineWarning.
"""
from .dataset import Dataset, DatasetVideo
from .events import EVENT, Events, join
from .pipeline import PipelineError, PipelineWarning
from .recipe import Recipe, RecipeError
from .recordings import Stream, read, stream, write
from .sources import live, simulate
from .tensors import tensors, voxel_grid

__all__ = ["Dataset", "DatasetVideo", "EVENT", "Events", "PipelineError", "PipelineWarning", "Recipe", "RecipeError",
           "Stream", "join", "live", "read", "simulate", "stream", "tensors", "voxel_grid", "write"]
