# SPDX-License-Identifier: LGPL-2.1-or-later
"""Data sets that are simulated on the fly from a recipe."""
from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import re
import tempfile
from typing import Iterator, Mapping, Optional, Sequence, overload

import numpy as np

from .events import Events
from .frames import Frames
from .pipeline import EVENT_CAPS, Gst, Pipeline, PipelineError, events_of, property_limits, quoted
from .recipe import PICTURES, TENSORS, Recipe, Value, Window, is_picture
from .sources import SINK
from .tensors import TENSOR_CAPS, tensor_of
from .video import VideoFile, VideoPipeline


@dataclasses.dataclass(frozen=True)
class DatasetVideo:
    """A video of a data set. Iterating over it simulates it, and yields the recipe's first output: an
    Events array per pair of consecutive frames, or tensors of shape (channels, height, width). Raises
    PipelineError if the video cannot be read; at its end, also if it is corrupt or has fewer frames than the
    recipe asks for.

    name: its path below the first folder of the pattern that has a wildcard, without extension.
    path: of the file, or of the folder of pictures.
    split: its part of the data set, such as "train"; empty if the recipe has no split."""

    recipe: Recipe
    name: str
    path: str
    split: str = ""

    @functools.cached_property
    def parameters(self) -> Mapping[str, Value]:
        """Properties of the simulator, drawn from the recipe's seed and the name of the video."""
        return self.recipe.drawn(self.name)

    @property
    def line(self) -> str:
        """The elements from frames to events."""
        return self.recipe.line(self.parameters)

    def __iter__(self) -> Iterator[Events] | Iterator[np.ndarray]:
        if self.recipe.outputs[0] == TENSORS:
            with self.playing(f"eventtensor {self.recipe.tensors} ! {TENSOR_CAPS} ! {SINK}") as pipeline:
                yield from map(tensor_of, self._samples(pipeline))
        else:
            yield from self.events()

    def events(self) -> Iterator[Events]:
        """Yields an array per pair of consecutive frames, regardless of the recipe's output."""
        with self.playing(SINK) as pipeline:
            pipeline.gaps_as_buffers()
            yield from map(events_of, self._samples(pipeline))

    def _samples(self, pipeline: Pipeline) -> Iterator[Gst.Sample]:
        """The output of a pipeline. At its end, raises PipelineError if the video cannot be used."""
        frames = Frames()
        frames.watch(pipeline.element("decoded").get_static_pad("sink"))
        yield from pipeline.samples()
        if fault := self.fault(frames, pipeline.duration()):
            raise PipelineError(f"{self.name}: {fault}")

    def fault(self, frames: Frames, duration: float) -> str:
        """Why a video of these frames cannot be used, such as "corrupt: 2 of 90 frames"; empty if it can.
        duration: of the file, in seconds; 0 = unknown."""
        pictures = len(pictures_of(self.path)) if os.path.isdir(self.path) else 0
        return frames.fault(self.recipe.min_frames, duration, pictures)

    @contextlib.contextmanager
    def playing(self, rest: str, threads: int = 0) -> Iterator[Pipeline]:
        """A pipeline that passes the events to the elements `rest`. Its element `decoded` passes the frames.

        threads: of the simulator, 0 = one per processor; the events do not depend on it."""
        recipe = self.recipe
        parameters = dict(self.parameters)
        if threads > 0 and "n-threads" in property_limits(recipe.simulator):
            parameters["n-threads"] = threads
        line = recipe.line(parameters)
        with contextlib.ExitStack() as stack:
            # Caps at the start or end of the line need an element before and after them.
            rest = f"identity ! {line} ! identity ! {EVENT_CAPS} ! {rest}"
            if recipe.window:
                made: Pipeline = VideoPipeline("appsrc name=window format=time", rest)
            elif os.path.isdir(self.path):
                folder = stack.enter_context(tempfile.TemporaryDirectory())
                made = VideoPipeline(_numbered_pictures(self.path, folder, recipe), rest)
            else:
                made = VideoFile(self.path, rest)
            pipeline = stack.enter_context(made)
            if recipe.window:
                width, height = recipe.window.width, recipe.window.height
                pipeline.feed("window", f"video/x-raw,format=GRAY8,width={width},height={height},{_framerate(recipe)}",
                              _moving_window(_scaled_picture(self.path, recipe.window), recipe))
            yield pipeline


class Dataset(Sequence[DatasetVideo]):
    """The videos of a recipe, by name. Nothing is stored: iterating over a video simulates it, with the
    same events as event-dataset writes.

    split: only the videos of this part, such as "train".

    Raises RecipeError if the recipe has an error or no video is found."""

    def __init__(self, recipe: str | os.PathLike[str] | Recipe, split: Optional[str] = None) -> None:
        self.recipe = recipe if isinstance(recipe, Recipe) else Recipe.load(recipe)
        if split is not None and split not in self.recipe.split:
            raise ValueError(f"the recipe has no part {split!r}")
        inputs = self.recipe.inputs()
        parts = self.recipe.parts(inputs)
        self._videos = [DatasetVideo(self.recipe, name, path, parts[name]) for name, path in inputs.items()
                        if split in (None, parts[name])]

    def __len__(self) -> int:
        return len(self._videos)

    @overload
    def __getitem__(self, index: int) -> DatasetVideo: ...

    @overload
    def __getitem__(self, index: slice) -> list[DatasetVideo]: ...

    def __getitem__(self, index: int | slice) -> DatasetVideo | list[DatasetVideo]:
        return self._videos[index]


def pictures_of(folder: str) -> list[str]:
    """The paths of the pictures of a folder, sorted with numbers by value: 2 before 10."""
    names = filter(is_picture, os.listdir(folder))
    in_order = sorted(names, key=lambda name: [(int(part), "") if part.isdecimal() else (0, part)
                                               for part in re.split(r"(\d+)", name)])
    return [os.path.join(folder, name) for name in in_order]


def _framerate(recipe: Recipe) -> str:
    """The framerate as a field of caps."""
    assert recipe.framerate
    return f"framerate={recipe.framerate.numerator}/{recipe.framerate.denominator}"


def _numbered_pictures(path: str, folder: str, recipe: Recipe) -> str:
    """A source of the pictures of a folder: multifilesrc, which reads links with numbers as names."""
    if not recipe.framerate:
        raise PipelineError(f"{path} is a folder of pictures, and the recipe has no framerate")
    pictures = pictures_of(path)
    kinds = {PICTURES[os.path.splitext(picture)[1].lower()] for picture in pictures}
    if len(kinds) != 1:
        raise PipelineError(f"{path} has pictures of different formats")
    for number, picture in enumerate(pictures):
        os.symlink(os.path.abspath(picture), os.path.join(folder, f"{number:08}"))
    numbered = quoted(folder.replace("%", "%%") + "/%08d")
    return f"multifilesrc location={numbered} caps=\"{kinds.pop()},{_framerate(recipe)}\" ! decodebin"


def _scaled_picture(path: str, window: Window) -> np.ndarray:
    """A picture, scaled and cropped to hold the window in each of its positions."""
    width, height = window.width + window.distance, window.height + window.distance
    with VideoFile(path, f"aspectratiocrop aspect-ratio={width}/{height} ! videoconvert ! videoscale"
                   f" ! video/x-raw,format=GRAY8,width={width},height={height},pixel-aspect-ratio=1/1 ! {SINK}"
                   ) as pipeline:
        sample = next(pipeline.samples(), None)
    if sample is None:
        raise PipelineError(f"{path} has no picture that can be decoded")
    buffer = sample.get_buffer()
    return np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8).reshape(height, -1)


def _moving_window(picture: np.ndarray, recipe: Recipe) -> Iterator[Gst.Buffer]:
    """Yields the window at each of its positions on a scaled picture."""
    assert recipe.window and recipe.framerate
    width, height, duration = recipe.window.width, recipe.window.height, Gst.SECOND / recipe.framerate
    for number, (left, top) in enumerate(recipe.window.corners()):
        rows = np.pad(picture[top:top + height, left:left + width], ((0, 0), (0, -width % 4)))  # as GStreamer pads them
        buffer = Gst.Buffer.new_wrapped(rows.tobytes())
        buffer.pts, buffer.duration = round(number * duration), round(duration)
        yield buffer
