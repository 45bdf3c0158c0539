# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recordings of events: read, played window by window, and written."""
from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
import operator
import os
import sys
import uuid
from typing import Iterator, Optional, overload

import numpy as np

from .events import Events, join
from .pipeline import (
    EVENT_CAPS, LABEL, GLib, Gst, GstEventCamera, Pipeline, PipelineError, events_of, given_size,
    quoted, sensor_size, utf8_path, warn)
from .sources import SINK

# Latest time of an event that readers of files accept, in microseconds: 142 years.
MAX_TIME = 1 << 52
# Longest pause whose windows are returned, in seconds and in windows.
MAX_PAUSE = 60
MAX_EMPTY = 10_000
# Largest len() of a stream: 51 days of 33 ms.
MAX_LEN = 1 << 27
# Microseconds of the buffers that are written.
BUFFER = 10_000
XYTP = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])


def _writers() -> Iterator[tuple[str, str]]:
    """Extensions of files, and elements that write them, which have "output-extensions" in GStreamer's registry."""
    for factory in Gst.Registry.get().get_feature_list(Gst.ElementFactory):
        is_sink = factory.list_is_type(Gst.ELEMENT_FACTORY_TYPE_SINK)
        extensions = factory.get_metadata("output-extensions")
        for extension, *settings in map(str.split, extensions.split(";") if extensions else ()):
            writer = " ".join([factory.get_name(), *settings])
            yield f".{extension}", writer + (" name=file" if is_sink else " ! filesink name=file")


WRITERS = dict(sorted(_writers()))


@dataclasses.dataclass(frozen=True)
class Stream:
    """Windows of a recording, in order: iterate over it, take its len(), index it, or slice it.

    window: length of a window in seconds, from 1e-6 to 10, rounded to whole microseconds.
    start, end: the part of the recording in seconds from its first event, end exclusive; None = to its end. A part
        past the end is empty.

    Iterating yields an Events array a window, empty where nothing happened; only one is in memory. Windows of pauses
    of more than a minute or 10,000 windows are skipped, with a PipelineWarning; start and end of each array are its
    times. len() and indices count these windows, too. The window that the recording ends in is the last one. Indexing
    and slices seek in the file. The duration, len(), and indices from the end look for the end of the recording, once:
    a file without an index is read to its end.
    Raises PipelineError if the file cannot be read, and ValueError for other lengths and parts."""

    path: str
    window: float = 0.033
    start: float = 0.0
    end: Optional[float] = None

    def __post_init__(self) -> None:
        if not 1e-6 <= self.window <= 10:
            raise ValueError(f"window is {self.window} s; it must be from 1e-6 to 10 s")
        _expect_part(self.start, self.end)
        object.__setattr__(self, "window", round(self.window * 1e6) / 1e6)
        object.__setattr__(self, "start", min(self.start, MAX_TIME / 1e6))
        object.__setattr__(self, "end", None if self.end is None else min(self.end, MAX_TIME / 1e6))

    @property
    def width(self) -> int:
        """Width of the sensor, in pixels."""
        return self._size[0]

    @property
    def height(self) -> int:
        """Height of the sensor, in pixels."""
        return self._size[1]

    @property
    def duration(self) -> float:
        """Duration of the part, in seconds."""
        return self._length(self._whole)

    def _length(self, whole: float) -> float:
        """Length of the part, in a recording of `whole` seconds."""
        return max(0.0, min(whole, math.inf if self.end is None else self.end) - self.start)

    def between(self, start: float, end: Optional[float] = None) -> Stream:
        """The part from `start` to `end`, in seconds after the start of this one. Raises ValueError unless
        0 <= start <= end."""
        _expect_part(start, end)
        first = self.start + start
        lasts = [last for last in (self.end, None if end is None else self.start + end) if last is not None]
        part = dataclasses.replace(self, start=first, end=max(first, min(lasts)) if lasts else None)
        vars(part).update({name: known for name, known in vars(self).items() if name in ("_size", "_whole")})
        return part

    def _windows(self, seconds: float) -> int:
        """The number of windows that begin within `seconds`."""
        return -(-round(seconds * 1e6) // round(self.window * 1e6))

    @property
    def _count(self) -> int:
        return self._windows(self.duration)

    def __len__(self) -> int:
        count = self._count
        if count > MAX_LEN:
            # list() reserves memory for len() items, but not after a TypeError.
            raise TypeError(f"{self.path} has {count} windows, most of them in pauses; iterating skips these")
        return count

    @overload
    def __getitem__(self, index: int) -> Events: ...

    @overload
    def __getitem__(self, index: slice) -> Stream: ...

    def __getitem__(self, index: int | slice) -> Events | Stream:
        if isinstance(index, slice):
            is_from_end = min(index.start or 0, index.stop or 0) < 0
            first, last, step = index.indices(self._count if is_from_end else sys.maxsize)
            if step != 1:
                raise ValueError("a slice of a stream has no step")
            return self.between(first * self.window, None if index.stop is None else max(first, last) * self.window)
        index = operator.index(index)
        first = index + self._count if index < 0 else index
        if first >= 0:
            for events in self.between(first * self.window, (first + 1) * self.window):
                return events
        raise IndexError(f"the stream has no window {index}")

    def __iter__(self) -> Iterator[Events]:
        window = round(self.window * 1e6)
        origin: Optional[int] = None
        index = 0
        parts: list[Events] = []
        size = (0, 0)
        limit = math.inf if self.end is None else self._windows(self.end - self.start)
        end = math.inf

        def complete(last: float) -> Iterator[Events]:
            """The windows before number `last`."""
            nonlocal index
            while index < min(last, limit):
                start = (origin or 0) + index * window
                events = join(parts) if parts else Events(0, *size)
                events.start, events.end = start / 1e6, min(start + window, end) / 1e6
                parts.clear()
                yield events
                index += 1
                if min(last, limit) - index > min(MAX_PAUSE / self.window, MAX_EMPTY):
                    warn(f"{self.path}: a pause of {(last - index) * self.window:.0f} s: its windows are skipped")
                    index = int(min(last, limit))

        with contextlib.closing(self._chunks()) as chunks:
            for events in chunks:
                size = events.width, events.height
                first = round(events.start * 1e6)
                if origin is None:
                    origin = first
                    if self.end is not None:
                        end = origin + round((self.end - self.start) * 1e6)
                yield from complete((first - origin) // window)
                if index >= limit:
                    return
                if len(events) > 0:
                    parts.append(events)
                else:
                    yield from complete((round(events.end * 1e6) - origin) // window)
            if parts:
                yield from complete(index + 1)

    def _chunks(self) -> Iterator[Events]:
        """The events of each buffer, of at most a window; empty for a gap, which may be long."""
        with self._open() as pipeline:
            yield from self._play(pipeline)

    def _play(self, pipeline: Pipeline) -> Iterator[Events]:
        if self.start > 0 or self.end is not None:
            pipeline.set_state(Gst.State.PAUSED)
            pipeline.seek(self.start, self.end)
        yield from map(events_of, pipeline.samples())

    @contextlib.contextmanager
    def _open(self) -> Iterator[Pipeline]:
        try:
            with Pipeline(f"filesrc location={quoted(self.path)} ! decodebin name=decoder caps={EVENT_CAPS}"
                          f" expose-all-streams=false ! {EVENT_CAPS} ! {SINK}") as pipeline:
                pipeline.on_element(self._configure)
                pipeline.gaps_as_buffers()
                yield pipeline
        except PipelineError as error:
            if error.element not in ("decoder", "typefind"):
                raise
            raise PipelineError(f"{self.path} is not a recording of events. If it is a video, ec.simulate() makes events"
                                " of it.", error.element) from None

    def _configure(self, element: Gst.Element) -> None:
        if element.find_property("buffer-duration"):
            element.set_property("buffer-duration", round(self.window * 1e6) * 1000)

    @functools.cached_property
    def _size(self) -> tuple[int, int]:
        """Width and height of the sensor."""
        with self._open() as pipeline:
            pipeline.set_state(Gst.State.PAUSED)
            return sensor_size(pipeline.caps())

    @functools.cached_property
    def _whole(self) -> float:
        """The duration of the recording, which readers may estimate or not know until they have read its end."""
        with self._open() as pipeline:
            pipeline.set_state(Gst.State.PAUSED)
            for start in max(pipeline.duration() - 1e-6, 0), 0:  # all of it, if nothing is at its end
                pipeline.seek(start, None)
                if sum(1 for _ in pipeline.samples()) > 0:
                    break
                pipeline.set_state(Gst.State.PAUSED)
            return pipeline.duration()


def _expect_part(start: float, end: Optional[float]) -> None:
    if not start >= 0 or (end is not None and not end >= start):
        raise ValueError(f"no part from {start} s to {'the end' if end is None else f'{end} s'}: give 0 <= start <= end")


def stream(path: str | os.PathLike[str], window: float = 0.033) -> Stream:
    """The windows of a recording, of `window` seconds each, from a file of any format that GStreamer plays.

    ec.stream(path)[30:60] and ec.stream(path).between(1.0, 2.0) are parts of it."""
    return Stream(os.fsdecode(path), window)


def read(path: str | os.PathLike[str], start: float = 0, end: Optional[float] = None) -> Events:
    """All events of a recording, or those with start <= time < end, in seconds from its first event.

    Shape (events,), 16 bytes each, with the times of the file. A part past the end is empty. Raises PipelineError
    if the file cannot be read or has no events to read, and ValueError unless 0 <= start <= end."""
    part = Stream(os.fsdecode(path), window=1, start=start, end=end)
    with part._open() as pipeline:
        events = join(part._play(pipeline))
        if events.width == 0:
            events.width, events.height = sensor_size(pipeline.caps())
        events.end = max(events.end, events.start + part._length(pipeline.duration()))
    return events


def write(path: str | os.PathLike[str], events: np.ndarray, width: int = 0, height: int = 0) -> None:
    """Writes events to a file, whose extension selects the format: .raw (EVT3), .dat, .es, .csv, .txt, .npy,
    .npz, .aedat4, .mcap (ROS 2), .h5 (DSEC) or .hdf5 (Metavision).

    events: an array with the fields t (microseconds, from 0 to 2**52, sorted), x, y and p (ON if above 0); shape
        (events,).
        Labels of Events are written, too, if the format has them: .npz, .h5 and .csv.
    width, height: of the sensor, in pixels, 1 to 16384; may be omitted for Events of a known sensor.

    Only a complete file replaces an existing one. Raises ValueError for events that are not sorted, too late or
    outside the sensor, or an unknown extension, and PipelineError if the file cannot be written."""
    path = utf8_path(path)
    extension = os.path.splitext(path)[1].lower()
    if extension not in WRITERS:
        raise ValueError(f"{path}: the extension must be one of {' '.join(WRITERS)}")
    width, height = given_size(events, width, height)
    _check(events, width, height)
    writer = WRITERS[extension]
    if extension == ".csv" and _labels(events):
        writer = writer.replace("eventcsvenc", "eventcsvenc format=labels")
    with _replacing(path) as part, Pipeline(f"appsrc name=in format=time ! {writer}") as pipeline:
        pipeline.element("file").set_property("location", part)
        pipeline.feed("in", f"{EVENT_CAPS},width={width},height={height},framerate=0/1", _buffers(events))
        pipeline.set_state(Gst.State.PLAYING)
        pipeline.wait()


@contextlib.contextmanager
def _replacing(path: str) -> Iterator[str]:
    """Yields a temporary path, whose file replaces `path` at the end, or is removed on failure; for devices and pipes,
    the path itself."""
    target = os.path.realpath(path)
    if os.path.exists(target) and not os.path.isfile(target):
        yield target
        return
    part = f"{target}.{uuid.uuid4().hex[:8]}.part"
    try:
        with open(part, "xb"):
            pass
    except OSError as error:
        raise PipelineError(f"{path} cannot be written: {error.strerror}") from None
    try:
        yield part
        os.replace(part, target)
    except BaseException:
        os.remove(part)
        raise


def _check(events: np.ndarray, width: int, height: int) -> None:
    for name in "txy":
        if not np.issubdtype(events[name].dtype, np.integer):
            raise ValueError(f"{name} is {events[name].dtype}; it must be whole numbers, of an integer type")
    t = events["t"]
    if len(events) > 0 and (t[0] < 0 or np.any(t[1:] < t[:-1])):
        raise ValueError("events must be sorted by time, from 0 on")
    if len(events) > 0 and not t[-1] <= MAX_TIME:
        raise ValueError(f"the last event is at {t[-1]} us; times must be at most 2**52 us, 142 years")
    if any(len(events) > 0 and (np.min(events[name]) < 0 or np.max(events[name]) >= size)
           for name, size in (("x", width), ("y", height))):
        raise ValueError(f"there are events outside the sensor of {width}x{height} pixels")
    for labels in _labels(events):
        if len(labels) != len(events):
            raise ValueError(f"there are {len(events)} events, but {len(labels)} labels")


def _labels(events: np.ndarray) -> list[np.ndarray]:
    """Causes and object classes, or nothing."""
    cause, object_class = getattr(events, "cause", None), getattr(events, "object_class", None)
    return [] if cause is None or object_class is None else [cause, object_class]


def _buffers(events: np.ndarray) -> Iterator[Gst.Buffer]:
    """The events in buffers of a grid, without empty buffers."""
    t = np.asarray(events["t"])
    cuts = [0, *(np.flatnonzero(t[1:] // BUFFER != t[:-1] // BUFFER) + 1), len(events)]
    for first, last in itertools.pairwise(cuts) if len(events) > 0 else []:
        part = events[first:last]
        yield buffer_of(part, int(part["t"][0]) // BUFFER * BUFFER, BUFFER)


def buffer_of(events: np.ndarray, start: int, duration: int) -> Gst.Buffer:
    """A buffer of a stream that covers `duration` microseconds from `start` on, with its events and labels."""
    packed = np.empty(len(events), XYTP)
    packed["t"] = events["t"] - start
    packed["x"] = events["x"]
    packed["y_p"] = events["y"]
    packed["y_p"] |= (events["p"] > 0) * np.uint16(0x8000)
    buffer = Gst.Buffer.new_wrapped(packed.tobytes()) if len(events) > 0 else Gst.Buffer.new()
    buffer.pts, buffer.duration = start * 1000, duration * 1000
    if labels := _labels(events):
        fields = np.zeros(len(events), LABEL)
        fields["cause"], fields["object_class"] = labels
        GstEventCamera.buffer_add_event_camera_label_bytes(buffer, GLib.Bytes.new(fields.tobytes()))
    return buffer
