# SPDX-License-Identifier: LGPL-2.1-or-later
"""Arrays of events."""
from __future__ import annotations

import math
from typing import Any, Iterable, Optional

import numpy as np

# The layout of GstEventCameraAbsoluteEvent.
EVENT = np.dtype({"names": ["t", "x", "y", "p"], "formats": ["<i8", "<u2", "<u2", "?"],
                  "offsets": [0, 8, 10, 12], "itemsize": 16})


class Events(np.ndarray):
    """A one-dimensional array of events, sorted by time, with the fields t (int64, microseconds), x and y
    (uint16, from the top left) and p (bool, True = ON).

    width, height: of the sensor, in pixels; 0 if not known.
    start, end: time span of the array, in seconds, as in `t`. A slice keeps the span of the whole.
    stream_start: `start` as players count, in seconds; differs for videos whose timestamps do not begin at 0, such as
        MP4 with B-frames, and for recordings. Files written from a simulation begin at this time.
    arrival: time at which live() yielded the array, in seconds as in `t`: `arrival - end` is its latency. NaN in others.
    cause, object_class: labels of the events, uint8 and uint16 of the same shape, where an element has
    labelled them (GstEventCameraLabel); else None. They follow an index, a slice, copy() and sort();
    functions of NumPy that move rows by themselves, such as np.random.shuffle(), leave them behind.
    """

    width: int
    height: int
    start: float
    end: float
    stream_start: float
    arrival: float
    cause: Optional[np.ndarray]
    object_class: Optional[np.ndarray]

    def __new__(cls, count: int, width: int = 0, height: int = 0, start: float = 0, end: float = 0) -> Events:
        events = super().__new__(cls, (count,), EVENT)
        events.width, events.height, events.start, events.end = width, height, start, end
        events.stream_start = start
        return events

    def __array_finalize__(self, source: Any) -> None:
        self.width = getattr(source, "width", 0)
        self.height = getattr(source, "height", 0)
        self.start = getattr(source, "start", 0.0)
        self.end = getattr(source, "end", 0.0)
        self.stream_start = getattr(source, "stream_start", 0.0)
        self.arrival = getattr(source, "arrival", math.nan)
        self.cause = self.object_class = None

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, str):
            return self.view(np.ndarray)[index]
        part = super().__getitem__(index)
        if self.cause is not None and self.object_class is not None and isinstance(part, Events):
            is_fields = isinstance(index, list) and any(isinstance(name, str) for name in index)
            rows = slice(None) if is_fields else index
            part.cause, part.object_class = self.cause[rows], self.object_class[rows]
        return part

    def sort(self, *args: Any, **kwargs: Any) -> None:
        """In place, with the labels."""
        if self.cause is None or self.object_class is None:
            super().sort(*args, **kwargs)
            return
        places = self.view(np.ndarray).argsort(*args, **kwargs)
        for values in (self.view(np.ndarray), self.cause, self.object_class):
            values[:] = values[places]

    def copy(self, order: Any = "C") -> Events:
        events = super().copy(order)
        if self.cause is not None and self.object_class is not None:
            events.cause, events.object_class = self.cause.copy(), self.object_class.copy()
        return events

    def __copy__(self) -> Events:
        return self.copy()

    def __deepcopy__(self, _: Any) -> Events:
        return self.copy()

    def __reduce__(self) -> Any:
        create, arguments, state = super().__reduce__()
        return create, arguments, (state, self.__dict__)

    def __setstate__(self, state: Any) -> None:
        array, attributes = state
        super().__setstate__(array)
        self.__dict__.update(attributes)

    def between(self, start: float, end: float) -> Events:
        """The events with start <= t < end, in seconds, as a view. The times of a recording need not begin at 0."""
        bounds = np.searchsorted(self["t"], [round(start * 1e6), round(end * 1e6)])
        part = self[bounds[0]:bounds[1]]
        part.start, part.end = start, end
        return part


def join(chunks: Iterable[Events]) -> Events:
    """Concatenates chunks that follow each other: from the start of the first to the end of the last, with the
    largest sensor size, which grows with files that do not state it, and labels if all events have them. A single
    chunk is returned as it is.

    np.concatenate() would lose the size of the sensor, the times and the labels."""
    parts = list(chunks)
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return Events(0)
    width, height = max(part.width for part in parts), max(part.height for part in parts)
    events = Events(sum(map(len, parts)), width, height, parts[0].start, parts[-1].end)
    events.stream_start = parts[0].stream_start
    np.concatenate(parts, out=events)
    filled = [part for part in parts if len(part) > 0]
    if filled and all(part.cause is not None for part in filled):
        events.cause = np.concatenate([part.cause for part in filled])
        events.object_class = np.concatenate([part.object_class for part in filled])
    return events


def packed_events(events: np.ndarray) -> np.ndarray:
    """Converts to a contiguous array of EVENT, if it is none. Fields are found by name; p is ON if above 0.
    Raises ValueError for times and pixels that the fields of EVENT cannot hold."""
    if events.dtype == EVENT and events.flags.c_contiguous:
        return events
    packed = np.empty(len(events), EVENT)
    packed["p"] = events["p"] > 0
    for name in ("t", "x", "y"):
        with np.errstate(invalid="ignore"):  # NaN
            packed[name] = events[name]
        if not np.array_equal(packed[name], events[name]):
            limits = np.iinfo(EVENT[name])
            raise ValueError(f"{name} must be whole numbers from {limits.min} to {limits.max}")
    return packed
