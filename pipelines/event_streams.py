# SPDX-License-Identifier: LGPL-2.1-or-later
"""Reads videos and recordings as NumPy arrays, simulates events from videos, and compares two streams."""
import argparse
import json
import math
import os
import sys
import tempfile
from dataclasses import dataclass, field, replace

try:
    import gi
    import gst_eventcamera as ec
    import numpy as np

    gi.require_version("GstVideo", "1.0")
    from gi.repository import GstVideo
    from gst_eventcamera.pipeline import Gst, Pipeline, PipelineError, events_of, quoted
    from gst_eventcamera.recordings import buffer_of
    from gst_eventcamera.sources import SINK
    from gst_eventcamera.video import VideoFile
except (ImportError, ValueError) as missing:
    sys.exit(f"error: {missing}\nInstall python3-gst-eventcamera, a Debian package of gst-eventsim, or in a checkout"
             " run the programs of pipelines/")

from event_files import MAX_SECONDS, listed_pictures  # noqa: E402

# Duration of a buffer of compared events, whose times have 32 bits, in microseconds.
MAX_BUFFER = 1 << 31

# Frames simulated before a span, so that pixels have a history.
PAST_FRAMES = 5

# A pixel within this many grey levels of white, of 255, counts as overexposed.
WHITE_MARGIN = 5

# Of red, green and blue in luma, by BT.709.
RGB_WEIGHTS = 0.2126, 0.7152, 0.0722


@dataclass
class Frame:
    time: int  # ns
    buffer: Gst.Buffer
    overexposed: np.ndarray = None  # by row and column; None until needed


@dataclass
class Sensor:
    width: int = 0  # 0 = as in the first recording
    height: int = 0
    mask: np.ndarray = None  # by row and column: whether a pixel of the camera can fire

    def of_camera(self, events):
        """The events of pixels that can fire."""
        if self.mask is None:
            return events
        return events[self.mask[events["y"], events["x"]]]

    def pixels_of(self, events):
        """The pixel of each event, numbered in raster order."""
        return events["y"].astype(np.int64) * self.width + events["x"]


@dataclass
class Video(Sensor):
    caps: str = ""
    frames: list = field(default_factory=list)
    origin: int = 0  # time of the video's first frame, which may not be in `frames`, ns

    @property
    def info(self):
        return GstVideo.VideoInfo.new_from_caps(Gst.Caps.from_string(self.caps))

    def luma(self, frame):
        """The luma of a frame, by row and column; 255 is the maximum of its format."""
        info = self.info
        data = frame.buffer.extract_dup(0, frame.buffer.get_size())

        def component(i):
            plane, depth = info.finfo.plane[i], info.finfo.depth[i]
            order = "<" if info.finfo.flags & GstVideo.VideoFormatFlags.LE else ">"
            values = np.ndarray((self.height, self.width), np.uint8 if depth == 8 else f"{order}u2", data,
                                info.offset[plane] + info.finfo.poffset[i],
                                (info.stride[plane], info.finfo.pixel_stride[i]))
            return values * (255 / ((1 << depth + info.finfo.shift[i]) - 1))

        if info.finfo.flags & GstVideo.VideoFormatFlags.RGB:
            return sum(weight * component(i) for i, weight in enumerate(RGB_WEIGHTS))
        return component(0)

    def overexposed(self, frame):
        """Which pixels of a frame are white, by row and column."""
        if frame.overexposed is None:
            is_narrow = self.info.colorimetry.range.value_nick == "16-235"
            frame.overexposed = self.luma(frame) >= (235 if is_narrow else 255) - WHITE_MARGIN
        return frame.overexposed

    def visible(self, events):
        """All events except of pixels that are white in the frames before and after them."""
        cuts = np.searchsorted(events["t"], [frame.time // 1000 for frame in self.frames], side="right")
        parts = [events[:cuts[0]]]
        for before, after, first, last in zip(self.frames, self.frames[1:], cuts, cuts[1:]):
            white = self.overexposed(before) & self.overexposed(after)
            part = events[first:last]
            parts.append(part[~white[part["y"], part["x"]]])
        return np.concatenate([*parts, events[cuts[-1]:]])


@dataclass
class Span:
    """The time (start, end], in microseconds."""

    start: int
    end: int

    def of(self, events):
        first, last = np.searchsorted(events["t"], [self.start, self.end], side="right")
        return events[first:last]

    @property
    def seconds(self):
        return (self.end - self.start) / 1e6


# options


def seconds(text, signed=False):
    """The type of an option that is a time."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) < MAX_SECONDS or (value < 0 and not signed):
        lowest = "" if signed else "from 0 on, "
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds {lowest}below 1e9")
    return value


def expect_writable(path, inputs):
    """Raises RuntimeError if the path cannot be written, or is an input; called before long work."""
    for read in inputs:
        if os.path.exists(path) and os.path.exists(read) and os.path.samefile(path, read):
            raise RuntimeError(f"{path} is read, so it cannot be written; name another file")
    folder = os.path.dirname(path) or "."
    place = path if os.path.exists(path) else folder
    if os.path.isdir(path) or not os.path.isdir(folder) or not os.access(place, os.W_OK):
        raise RuntimeError(f"{path} cannot be written; name a file in a folder that exists and that you may write to")


# pipelines


def samples_of(description, feeds=()):
    """Plays a pipeline, and yields the samples of its appsink `out`. Each feed is the name of an appsrc, its caps
    and its buffers."""
    with Pipeline(description) as pipeline:
        for feed in feeds:
            pipeline.feed(*feed)
        yield from pipeline.samples()


def png_of(pixels):
    """Encodes grey or RGB values from 0 to 255, by row and column, as PNG."""
    height, width, *colours = pixels.shape
    rows = pixels.astype(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % 4)))  # as GStreamer pads them
    caps = f"video/x-raw,format={'RGB' if colours else 'GRAY8'},width={width},height={height},framerate=0/1"
    encoded, = [sample.get_buffer() for sample in samples_of(
        "appsrc name=pixels ! pngenc ! appsink name=out sync=false",
        [("pixels", caps, [Gst.Buffer.new_wrapped(rows.tobytes())])])]
    return encoded.extract_dup(0, encoded.get_size())


# reading


def read_pictures(path, start, end):
    """A text file of lines "seconds picture"; None if it is something else."""
    entries = listed_pictures(path)
    if entries is None:
        return None
    if not entries:
        raise RuntimeError(f"{path}: no pictures; give a line \"seconds picture\" for each")
    times = [time for time, _ in entries]
    start, end = (time + times[0] for time in (start, end))
    first = max([i for i, time in enumerate(times) if time <= start], default=0)
    first = max(first - PAST_FRAMES, 0)
    last = min([i for i, time in enumerate(times) if time >= end], default=len(times) - 1)
    video = None
    for time, picture in entries[first:last + 1]:
        part = decode(picture, 0, 0)
        video = video or Video(part.width, part.height, caps=part.caps, origin=times[0])
        if part.caps != video.caps:
            raise RuntimeError(f"{picture} differs in size or format from the pictures before it")
        video.frames.append(Frame(time, part.frames[0].buffer))
    return video


def frames_of(pipeline, path):
    try:
        yield from pipeline.samples()
    except PipelineError:
        if pipeline.has_only_events:
            raise RuntimeError(f"{path}: events without frames; give the video of the scene, too") from None
        raise


def decode(path, start, end):
    """The frames of a time span, and a few before it."""
    video = Video()
    sinks = (pad for pad in Gst.ElementFactory.find("eventsim-dvs").get_static_pad_templates()
             if pad.direction == Gst.PadDirection.SINK)
    with VideoFile(path, f"capsfilter caps=\"{next(sinks).get_caps().to_string()}\" ! {SINK}") as pipeline:
        for sample in frames_of(pipeline, path):
            buffer = sample.get_buffer()
            if not video.frames:
                video.caps = sample.get_caps().to_string()
                info = sample.get_caps().get_structure(0)
                video.width, video.height = info.get_value("width"), info.get_value("height")
                video.origin = buffer.pts
            elif video.frames[-1].time - video.origin >= end > 0:
                break
            if buffer.pts - video.origin <= start:
                del video.frames[:-PAST_FRAMES]
            # A decoder waits for its few buffers to come back.
            video.frames.append(Frame(buffer.pts, buffer.copy_deep()))
    if not video.frames:
        raise RuntimeError(f"{path}: no video frames; name a video, or a text file of lines \"seconds picture\"")
    return video


def read_video(path, start, end):
    """The frames from a few before `start` to the first at or after `end`, in seconds after the
    video's first frame."""
    start, end = start * 1e9, end * 1e9
    return read_pictures(path, start, end) or decode(path, start, end)


def read_mask(path, sensor):
    """Which pixels are white in a picture of the sensor's size."""
    picture = decode(path, 0, 0)
    if (picture.width, picture.height) != (sensor.width, sensor.height):
        raise RuntimeError(f"{path} has {picture.width} x {picture.height} pixels, the sensor has"
                           f" {sensor.width} x {sensor.height}")
    return picture.luma(picture.frames[0]) >= 128


def read_recording(path, sensor):
    """All events of a file."""
    try:
        if os.path.splitext(path)[1].lower() in (".csv", ".txt") and sensor.width > 0:
            # Text files do not state the sensor size.
            chunks = list(ec.live(f"filesrc location={quoted(path)} ! eventcsvdec"
                                  f" ! application/x-event-camera,width={sensor.width},height={sensor.height}"
                                  " ! identity"))
            events = ec.join(chunks)
        else:
            events = ec.read(path)
    except ec.PipelineError as error:
        raise RuntimeError(f"{path}: {error}") from error
    if sensor.width == 0:
        sensor.width, sensor.height = events.width, events.height
    if events.width > sensor.width or events.height > sensor.height:
        raise RuntimeError(f"{path}: it has {events.width} x {events.height} pixels, more than the {sensor.width} x"
                           f" {sensor.height} that it is compared with")
    if len(events) > 0 and (events.width, events.height) != (sensor.width, sensor.height):
        # If a file does not state its size, readers assume the smallest known sensor that holds the events.
        print(f"warning: {path} has {events.width} x {events.height} pixels, what it is compared with has {sensor.width}"
              f" x {sensor.height}; this is right only if the file does not state its size", file=sys.stderr)
    return events


def read_camera(path, sensor, mask):
    """The events of a file, of the pixels that are white in a picture, if one is given. Sets the mask of the sensor."""
    events = read_recording(path, sensor)
    if mask and sensor.mask is None:
        sensor.mask = read_mask(mask, sensor)
    events = sensor.of_camera(events)
    if len(events) == 0:
        raise RuntimeError(f"{path}: no events" + (" where the mask is white" if mask else ""))
    return events


# simulating and comparing


def simulate(video, element):
    """The events that an element generates from a video, where the frames are not overexposed."""
    buffers = []
    # A lag may move frames before 0, where there is no PTS.
    origin = -min(video.frames[0].time // 1000, 0)
    for frame in video.frames:
        # Buffer.copy() would only take another reference.
        buffer = frame.buffer.copy_region(
            Gst.BufferCopyFlags.MEMORY | Gst.BufferCopyFlags.META, 0, frame.buffer.get_size())
        buffer.pts = frame.time + origin * 1000
        buffers.append(buffer)
    parts = map(events_of, samples_of(
        f"appsrc name=frames format=time ! {element} ! application/x-event-camera ! appsink name=out sync=false",
        [("frames", video.caps, buffers)]))
    events = ec.join(parts)
    events["t"] -= origin
    return video.visible(video.of_camera(events))


def feed_of(name, sensor, events, span):
    """The events of a time span, for samples_of()."""
    caps = (f"application/x-event-camera,format=XYTP,width={sensor.width},height={sensor.height},"
            "framerate=0/1")
    # A span that includes the time 0 starts before it, where there is no PTS.
    shift = max(0, -span.start)
    buffers = []
    for start in range(span.start, span.end, MAX_BUFFER):
        end = min(start + MAX_BUFFER, span.end)
        part = Span(start, end).of(events).copy()
        part["t"] += shift
        buffers.append(buffer_of(part, start + shift, end - start))
    return name, caps, buffers


def reconstruct(sensor, events, span):
    """Grey pictures of the brightness, 20 a second, from 0 to 1, by picture, row and column."""
    samples = samples_of("appsrc name=events format=time ! eventreconstruct ! video/x-raw,format=GRAY8,framerate=20/1"
                         " ! appsink name=out sync=false", [feed_of("events", sensor, events, span)])
    stride = -(-sensor.width // 4) * 4
    pictures = []
    for sample in samples:
        buffer = sample.get_buffer()
        rows = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8).reshape(-1, stride)
        pictures.append(rows[:, :sensor.width] / 255)
    return np.array(pictures)


def compare(sensor, recorded, simulated, span, picture=None):
    """The figures of eventcompare over a time span."""
    feeds = [feed_of("recorded", sensor, recorded, span), feed_of("simulated", sensor, simulated, span)]
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "figures.json")
        drawn = f" map={quoted(picture)}" if picture else ""
        for _ in samples_of(f"eventcompare name=compare location={quoted(path)}{drawn}"
                            " ! appsink name=out sync=false"
                            "  appsrc name=recorded format=time ! compare.reference"
                            "  appsrc name=simulated format=time ! compare.candidate", feeds):
            pass
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def counts(events):
    on = np.count_nonzero(events["p"])
    return np.array([on, len(events) - on], float)


def until(video, end):
    """A video up to the first frame at or after `end`, in microseconds."""
    frames = [frame for i, frame in enumerate(video.frames)
              if i == 0 or video.frames[i - 1].time < end * 1000]
    return replace(video, frames=frames)


def delayed(video, seconds):
    return replace(video, frames=[replace(frame, time=frame.time + round(seconds * 1e9)) for frame in video.frames])
