# SPDX-License-Identifier: LGPL-2.1-or-later
"""Running GStreamer pipelines, with failures as exceptions."""
from __future__ import annotations

import atexit
import math
import os
import sys
import warnings
from typing import Callable, Iterable, Iterator, Optional

import gi
import numpy as np

try:
    for namespace in ("Gst", "GstEventCamera"):
        gi.require_version(namespace, "1.0")
except ValueError as missing:
    raise ImportError(f"{missing}; on Debian, install: gir1.2-gst-plugins-base-1.0 gir1.2-gsteventcamera-1.0") from None
from gi.repository import GLib, Gst, GstEventCamera  # noqa: E402

from .events import EVENT, Events  # noqa: E402

Gst.init(None)

EVENT_CAPS = "application/x-event-camera,format=(string)XYTP"
LABEL = np.dtype([("object_class", "<u2"), ("cause", "u1"), ("reserved", "u1")])

# Python handles Ctrl-C only between calls, so none waits longer.
MAX_WAIT = Gst.SECOND // 10

# ID of the process that plays pipelines. A fork of it has GStreamer's state without its threads.
_playing_process: Optional[int] = None

# Pipelines that the end of the program stops.
_open: set[Pipeline] = set()


class PipelineError(RuntimeError):
    """A pipeline failed; the text comes from the element: what failed, on what, what to do.

    element: the name of the element, empty if the pipeline could not be made.
    error: the element's error, with its domain and code, if it posted one."""

    def __init__(self, text: str, element: str = "", error: Optional[GLib.Error] = None) -> None:
        super().__init__(text)
        self.element = element
        self.error = error


class PipelineWarning(UserWarning):
    """An element continues after a failure, such as a reader that skips corrupt data; the text comes from the
    element."""


def printable(path: str) -> str:
    """The path, with bytes that are not UTF-8 escaped."""
    return path.encode(errors="surrogateescape").decode(errors="backslashreplace")


def utf8_path(path: str | os.PathLike[str]) -> str:
    """A path as the value of a property. Raises PipelineError if it is not UTF-8, and ValueError if it has a NUL."""
    text = os.fsdecode(path)
    if "\0" in text:
        raise ValueError("embedded null byte")
    if text != printable(text):
        raise PipelineError(f"the name {printable(text)} is not UTF-8; rename it")
    return text


def quoted(path: str | os.PathLike[str]) -> str:
    """A path as a quoted value in a pipeline description. Raises as utf8_path()."""
    return '"' + utf8_path(path).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _text_of(message: Gst.Message, error: GLib.Error, cause: Optional[str]) -> str:
    return f"{message.src.get_name()}: {error.message} ({cause.splitlines()[-1] if cause else ''})"


def warn(text: str) -> None:
    """Warns at the line that calls the package, also through a cached property."""
    level, frame = 1, sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in (__package__, "functools"):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, PipelineWarning, stacklevel=level)


class Pipeline:
    """A pipeline with an appsink named `out`. As a context manager, it stops the pipeline on exit; so does the end of
    the program."""

    def __init__(self, description: str) -> None:
        try:
            # Without the flag, a wrong description leaks the elements that could be created.
            self._pipeline = Gst.parse_launch_full(description, None, Gst.ParseFlags.FATAL_ERRORS)
        except GLib.Error as error:
            raise PipelineError(error.message) from None
        self._bus = self._pipeline.get_bus()
        self._sink = self._pipeline.get_by_name("out")
        self._ended = False
        self._error: Optional[PipelineError] = None

    def __enter__(self) -> Pipeline:
        _open.add(self)
        return self

    def __exit__(self, *_: object) -> None:
        _open.discard(self)
        if _playing_process == os.getpid():  # a fork has no threads to stop
            self._pipeline.set_state(Gst.State.NULL)

    def element(self, name: str) -> Gst.Element:
        return self._pipeline.get_by_name(name)

    def on_element(self, configure: Callable[[Gst.Element], None]) -> None:
        """Calls configure() for each element that a decodebin adds."""
        self._pipeline.connect("deep-element-added", lambda _, __, element: configure(element))

    def gaps_as_buffers(self) -> None:
        """Replaces GAP events at the appsink by empty buffers."""
        pad = self._sink.get_static_pad("sink")

        def replace(_: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
            event = info.get_event()
            if event.type != Gst.EventType.GAP:
                return Gst.PadProbeReturn.OK
            buffer = Gst.Buffer.new()
            buffer.pts, buffer.duration = event.parse_gap()
            pad.chain(buffer)
            return Gst.PadProbeReturn.DROP

        pad.add_probe(Gst.PadProbeType.EVENT_DOWNSTREAM, replace)

    def feed(self, name: str, caps: str, buffers: Iterable[Gst.Buffer]) -> None:
        feed(self.element(name), Gst.Caps.from_string(caps), buffers)

    def raise_error(self, wait: int = 0) -> None:
        """Raises the first error that an element has posted, or posts within `wait` nanoseconds."""
        self._handle_messages(wait)
        if self._error:
            raise self._error

    def _handle_messages(self, wait: int = 0) -> None:
        """Keeps the first error and EOS, issues warnings, and drops all other messages."""
        kinds = Gst.MessageType.ERROR | Gst.MessageType.WARNING | Gst.MessageType.EOS
        while message := self._bus.timed_pop_filtered(wait, kinds):
            if message.type == Gst.MessageType.WARNING:
                warn(_text_of(message, *message.parse_warning()))
                continue
            wait = 0
            if message.type == Gst.MessageType.EOS:
                self._ended = True
            elif not self._error:
                error, cause = message.parse_error()
                self._error = PipelineError(_text_of(message, error, cause), message.src.get_name(), error)

    def set_state(self, state: Gst.State) -> None:
        """Sets a state, and waits for it unless it is PLAYING. Raises PipelineError in a process that was forked from
        one that has played pipelines."""
        global _playing_process
        if _playing_process not in (None, os.getpid()):
            raise PipelineError("GStreamer's threads do not survive a fork; start this process with the method"
                                " \"spawn\", as DataLoader(multiprocessing_context=\"spawn\") does")
        _playing_process = os.getpid()
        change = self._pipeline.set_state(state)
        while change == Gst.StateChangeReturn.ASYNC and state != Gst.State.PLAYING:
            change = self._pipeline.get_state(MAX_WAIT)[0]
            self.raise_error()
        failed = change == Gst.StateChangeReturn.FAILURE
        self.raise_error(wait=MAX_WAIT if failed else 0)
        if failed:
            raise PipelineError("the pipeline does not start")

    def seek(self, start: float, end: Optional[float]) -> None:
        """Seeks to `start` seconds of stream time, exactly. The pipeline must be paused."""
        stop = Gst.SeekType.NONE if end is None else Gst.SeekType.SET
        if not self._pipeline.seek(1, Gst.Format.TIME, Gst.SeekFlags.FLUSH | Gst.SeekFlags.ACCURATE,
                                   Gst.SeekType.SET, round(start * 1e9), stop, round((end or 0) * 1e9)):
            raise PipelineError("the source cannot seek")
        self.set_state(Gst.State.PAUSED)

    def duration(self) -> float:
        """Duration in seconds, 0 if unknown; the pipeline must be paused."""
        known, duration = self._pipeline.query_duration(Gst.Format.TIME)
        return duration / 1e9 if known else 0.0

    def caps(self) -> Gst.Caps:
        """Caps of the output; the pipeline must be paused."""
        return self._sink.get_static_pad("sink").get_current_caps()

    def now(self, segment: Gst.Segment) -> float:
        """Time in a segment, in seconds, by the clock of the playing pipeline; NaN if it is not within the segment."""
        time = segment.position_from_running_time(Gst.Format.TIME, self._pipeline.get_current_running_time())
        return math.nan if time == Gst.CLOCK_TIME_NONE else time / 1e9

    def samples(self, sink: str = "out") -> Iterator[Gst.Sample]:
        """Plays to the end, and yields the samples of an appsink."""
        source = self.element(sink)
        self.set_state(Gst.State.PLAYING)
        # By properties and signals: the class of an appsink made before GstApp was imported lacks its methods.
        while not source.get_property("eos"):
            if sample := source.emit("try-pull-sample", MAX_WAIT):
                self._handle_messages()
                yield sample
            else:
                self.raise_error()
        self.raise_error()

    def wait(self) -> None:
        """Waits until all sinks of a playing pipeline have reached the end."""
        while not self._ended:
            self.raise_error(MAX_WAIT)


def feed(source: Gst.Element, caps: Gst.Caps, buffers: Iterable[Gst.Buffer]) -> None:
    """Makes an appsrc push buffers as it needs them, and then EOS; an exception ends the pipeline with an error."""
    rest = iter(buffers)

    def push(_: Gst.Element, __: int) -> None:
        buffer = None
        try:
            buffer = next(rest, None)
        except (OSError, RuntimeError) as failure:
            error = GLib.Error.new_literal(Gst.StreamError.quark(), str(failure), Gst.StreamError.FAILED)
            source.post_message(Gst.Message.new_error(source, error, ""))
        if buffer is None:
            source.emit("end-of-stream")
        else:
            source.emit("push-buffer", buffer)

    source.set_property("caps", caps)
    source.connect("need-data", push)


@atexit.register
def _stop_all() -> None:
    """Stops pipelines before Python ends threads, which may hold the lock of a pad in a probe."""
    for pipeline in list(_open):
        pipeline.__exit__()


def property_limits(element: str) -> dict[str, tuple[float, float]]:
    """Minimum and maximum of each property of an element, infinite if it has none; integers for integer properties.
    Properties may follow the element's name. Raises PipelineError if the element does not exist."""
    name = element.split()[0]
    made = Gst.ElementFactory.make(name)
    if made is None:
        raise PipelineError(f"there is no element \"{name}\"")
    return {spec.name: (getattr(spec, "minimum", -math.inf), getattr(spec, "maximum", math.inf))
            for spec in made.list_properties()}


def expect_limits(elements: str) -> None:
    """Raises PipelineError if a number exceeds the limits of its property, which GStreamer ignores."""
    element = ""
    limits: dict[str, tuple[float, float]] = {}
    for word in elements.split():
        name, equals, value = word.partition("=")
        if not equals:  # an element, unless it is caps or an exclamation mark
            element, limits = word, property_limits(word) if Gst.ElementFactory.find(word) else {}
        low, high = limits.get(name, (-math.inf, math.inf))
        try:
            number = float(value.strip('"'))
        except ValueError:
            continue
        if not low <= number <= high and math.isfinite(low):
            raise PipelineError(f"{element} {word}: it must be from {low:g} to {high:g}")


def sensor_size(caps: Gst.Caps) -> tuple[int, int]:
    """Width and height of the sensor."""
    is_events, info = GstEventCamera.Info.from_caps(caps)
    if not is_events:
        raise PipelineError(f"{caps.get_structure(0).get_name()} is not a stream of events")
    return info.width, info.height


def given_size(events: np.ndarray, width: int, height: int) -> tuple[int, int]:
    """Width and height of the sensor, by default of the Events. Raises ValueError unless they are integers from 1 to
    16384."""
    sides = width or getattr(events, "width", 0), height or getattr(events, "height", 0)
    if not all(isinstance(side, (int, np.integer)) and 1 <= side <= GstEventCamera.MAX_SIDE for side in sides):
        raise ValueError(f"the sensor has {sides[0]}x{sides[1]} pixels; give a width and height from 1 to"
                         f" {GstEventCamera.MAX_SIDE}")
    return int(sides[0]), int(sides[1])


def events_of(sample: Gst.Sample) -> Events:
    """The events of a buffer."""
    buffer = sample.get_buffer()
    start = buffer.pts / 1e9
    duration = 0 if buffer.duration == Gst.CLOCK_TIME_NONE else buffer.duration / 1e9
    unpacked = GstEventCamera.unpack(buffer)
    if unpacked is None:
        raise PipelineError("a buffer of events cannot be read")
    events = np.frombuffer(bytearray(unpacked.get_data() or b""), EVENT).view(Events)
    events.width, events.height = sensor_size(sample.get_caps())
    events.start, events.end = start, start + duration
    stream_time = sample.get_segment().to_stream_time(Gst.Format.TIME, buffer.pts)
    events.stream_start = start if stream_time == Gst.CLOCK_TIME_NONE else stream_time / 1e9
    if labels := GstEventCamera.buffer_get_event_camera_label_meta(buffer) if len(events) > 0 else None:
        fields = np.frombuffer(labels.get_bytes().get_data(), LABEL)
        events.cause, events.object_class = fields["cause"].copy(), fields["object_class"].copy()
    return events
