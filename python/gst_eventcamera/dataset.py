# SPDX-License-Identifier: LGPL-2.1-or-later
"""Data sets that are simulated on the fly from a recipe."""
from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import pathlib
import re
from typing import Iterable, Iterator, Mapping, Optional, Sequence, overload

import numpy as np

from .events import Events
from .frames import Frames
from .pipeline import EVENT_CAPS, Gst, Pipeline, PipelineError, events_of, property_limits
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
        # Caps at the start or end of the line need an element before and after them.
        rest = f"identity ! {line} ! identity ! {EVENT_CAPS} ! {rest}"
        if not recipe.window and not os.path.isdir(self.path):
            with VideoFile(self.path, rest) as pipeline:
                yield pipeline
            return
        element, caps, buffers = (_moving_window if recipe.window else _pictures)(self.path, recipe)
        with VideoPipeline(f"appsrc name=source format=time ! {element}", rest) as pipeline:
            pipeline.feed("source", caps, buffers)
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


Fed = tuple[str, str, Iterator[Gst.Buffer]]  # an element after an appsrc, and the caps and buffers of the appsrc


def _framerate(recipe: Recipe) -> str:
    """The framerate as a field of caps."""
    assert recipe.framerate
    return f"framerate={recipe.framerate.numerator}/{recipe.framerate.denominator}"


def _timed(frames: Iterable[bytes], recipe: Recipe) -> Iterator[Gst.Buffer]:
    """Buffers of frames."""
    assert recipe.framerate
    duration = Gst.SECOND / recipe.framerate
    for number, frame in enumerate(frames):
        buffer = Gst.Buffer.new_wrapped(frame)
        buffer.pts, buffer.duration = round(number * duration), round(duration)
        yield buffer


def _pictures(path: str, recipe: Recipe) -> Fed:
    """The pictures of a folder."""
    if not recipe.framerate:
        raise PipelineError(f"{path} is a folder of pictures, and the recipe has no framerate")
    pictures = pictures_of(path)
    kinds = {PICTURES[os.path.splitext(picture)[1].lower()] for picture in pictures}
    if len(kinds) != 1:
        raise PipelineError(f"{path} has pictures of different formats")
    frames = (pathlib.Path(picture).read_bytes() for picture in pictures)
    return "decodebin", f"{kinds.pop()},{_framerate(recipe)}", _timed(frames, recipe)


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


def _moving_window(path: str, recipe: Recipe) -> Fed:
    """The window of a recipe at each of its positions on a picture."""
    assert recipe.window
    width, height = recipe.window.width, recipe.window.height
    picture = _scaled_picture(path, recipe.window)
    frames = (np.pad(picture[top:top + height, left:left + width], ((0, 0), (0, -width % 4))).tobytes()
              for left, top in recipe.window.corners())  # padded as GStreamer does
    caps = f"video/x-raw,format=GRAY8,width={width},height={height},{_framerate(recipe)}"
    return "identity", caps, _timed(frames, recipe)
