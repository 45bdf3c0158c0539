# SPDX-License-Identifier: LGPL-2.1-or-later
"""Long videos of a data set in clips, each a job, whose events are joined without a seam.

A clip decodes from MARGIN before its start on. These frames, which the previous clip has as well, must
be the same in both. Simulators that only remember a frame or two are warm after them; eventsim-dvs
continues from the state that the previous clip left. Events, times and labels go to a file, from which
another job feeds the filters and the writer, so that these see what they see of a whole video. If the
clips may differ from the whole, that job makes the video as a whole."""
import contextlib
import hashlib
import json
import os
import shutil
import struct
import tempfile

import gi
import gst_eventcamera as ec
import numpy as np
from dataset_video import decoders_of, making_of, state_of, versions, write_record
from gst_eventcamera.dataset import duration_of
from gst_eventcamera.frames import Frames
from gst_eventcamera.pipeline import EVENT_CAPS, GLib, Gst, GstEventCamera, Pipeline, quoted
from gst_eventcamera.sources import SINK

gi.require_version("GstVideo", "1.0")
from gi.repository import GstVideo  # noqa: E402

SECOND = Gst.SECOND
MARGIN = SECOND
# Frames that the margin must have: those that simulators remember, one more to compare, and the first after a
# seek, whose time may be changed.
MIN_MARGIN = 4
# A file with fewer bytes for each second of two clips is not opened to look at its duration.
MIN_RATE = 1000
WARMED_UP = {"eventsim-frame", "eventsim-dense", "eventsim-sparse", "eventsim-diff"}
WITH_STATE = {"eventsim-dvs"}
# Elements between decoder and simulator that know only one frame.
MEMORYLESS = {"aspectratiocrop", "gamma", "identity", "queue", "videobalance", "videobox", "videoconvert",
              "videoconvertscale", "videocrop", "videoflip", "videoscale"}
# Time, duration, whether it is discontinuous, and bytes of events and labels of a buffer.
HEADER = struct.Struct("<QQQQQ")
SEGMENT_FIELDS = ("rate", "applied_rate", "base", "offset", "start", "stop", "time", "position", "duration")


def folder_of(output, folder, name):
    """Folder of a video's clips."""
    return os.path.join(output, folder, name + ".d")


def has_state(video):
    """True if a clip needs the one before it."""
    return _simulator(video) in WITH_STATE


def cuts_of(video, length):
    """Returns where to cut a video into clips of this length in seconds; nowhere if it has fewer than two, or fails."""
    if length == 0 or video.recipe.window or os.path.isdir(video.path):
        return []
    with contextlib.suppress(ec.PipelineError, OSError):
        if os.path.getsize(video.path) < 2 * length * MIN_RATE:
            return []
        with Pipeline(f"filesrc location={quoted(video.path)} ! decodebin ! videoconvert ! {SINK}") as pipeline:
            pipeline.set_state(Gst.State.PAUSED)
            return [length * number for number in range(1, int(pipeline.duration() / length))]
    return []


def reason_against(video):
    """Why a video of this recipe cannot be cut; empty if it can."""
    if _simulator(video) not in WARMED_UP | WITH_STATE:
        return f"{_simulator(video)} cannot continue a clip"
    if "-state=" in video.line:
        return "it sets its own state"
    frames = [element.split()[0] for element in video.recipe.frames.split("!") if element.strip()]
    unknown = [element for element in frames if "/" not in element and element not in MEMORYLESS]
    return f"{unknown[0]}, in frames, may remember frames" if unknown else ""


def _simulator(video):
    return video.recipe.simulator.split()[0]


def remove_others(video, folder, cuts):
    """Removes clips that were made of another input or in another way, or whose records are not whole."""
    with contextlib.suppress(FileNotFoundError):
        for file in os.listdir(folder):
            if file.endswith(".json") and _origin_in(os.path.join(folder, file)) != _origin(video, cuts):
                shutil.rmtree(folder)
                return


def _origin_in(path):
    """What the clip of a record was made from; None if the record is not whole."""
    with contextlib.suppress(ValueError, KeyError, TypeError):
        return _read(path)["of"]


def _origin(video, cuts):
    """What the clips of a video are made from."""
    return {"making": making_of(video), "state": state_of(video.path), "cuts": cuts, "versions": versions()}


def _read(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


# making a clip


class NotJoinable(Exception):
    """The clips of a video may not be those of the whole."""


class ClipFrames(Frames):
    """Watches the frames of a clip, in nanoseconds of stream time from `start` until `end`, where it ends
    the stream. Keeps times and hashes of those that other clips have as well."""

    def __init__(self, start, end):
        super().__init__()
        self.start, self.end = start, end
        self._segment = self._layout = None
        self._forget()

    def _forget(self):
        self.times, self.corrupted, self.before, self.last, self.problem = [], 0, [], [], ""

    def watch(self, pad):
        pad.add_probe(Gst.PadProbeType.BUFFER | Gst.PadProbeType.EVENT_DOWNSTREAM | Gst.PadProbeType.EVENT_FLUSH,
                      self._look)
        self.watch_others(pad)

    def _look(self, pad, info):
        if not info.type & Gst.PadProbeType.BUFFER:
            self._look_at_event(info.get_event())
            return Gst.PadProbeReturn.OK
        buffer = info.get_buffer()
        time = self._segment.to_stream_time(Gst.Format.TIME, buffer.pts)
        if time == Gst.CLOCK_TIME_NONE:
            self.problem = "a frame has no time"
        elif self.end is not None and time >= self.end:
            # The sink pad refuses what follows; the source pad would take a late tag for an error.
            pad.send_event(Gst.Event.new_eos())
            return Gst.PadProbeReturn.DROP
        elif buffer.has_flags(Gst.BufferFlags.DISCONT) and (self.before or self.times):
            self.problem = "its frames are not one stream"
        if time < self.start:
            self.before.append([buffer.pts, self._hash_of(buffer)])
        else:
            self.add(buffer)
            if self.end is not None and time >= self.end - MARGIN:
                self.last.append([buffer.pts, self._hash_of(buffer)])
        return Gst.PadProbeReturn.OK

    def _look_at_event(self, event):
        if event.type == Gst.EventType.FLUSH_STOP:
            self._forget()  # what came before a seek
            return
        if event.type == Gst.EventType.SEGMENT:
            self._segment = event.parse_segment().copy()
        elif event.type == Gst.EventType.CAPS:
            caps = event.parse_caps().get_structure(0)
            depth = 2 if "16" in caps.get_value("format") else 1
            self._layout = caps.get_value("height"), caps.get_value("width") * depth
        elif event.type != Gst.EventType.GAP:
            return
        if self.before or self.times:
            self.problem = "its frames are not one stream"

    def _hash_of(self, buffer):
        """Hash of the luma, without row padding."""
        height, width = self._layout
        meta = GstVideo.buffer_get_video_meta(buffer)
        offset, stride = (meta.offset[0], meta.stride[0]) if meta else (0, -(-width // 4) * 4)
        luma = np.frombuffer(buffer.extract_dup(offset, stride * (height - 1) + width), np.uint8)
        rows = np.lib.stride_tricks.as_strided(luma, (height, width), (stride, 1))
        return hashlib.sha256(rows.tobytes()).hexdigest()


def make_clip(video, folder, cuts, number):
    """Writes the events of a clip, and then its record."""
    os.makedirs(folder, exist_ok=True)
    start = cuts[number - 1] * SECOND if number > 0 else 0
    end = cuts[number] * SECOND if number < len(cuts) else None
    frames = ClipFrames(start, end)
    record = {"of": _origin(video, cuts)}
    with tempfile.NamedTemporaryFile(dir=folder, suffix=".events", delete=False) as file:
        try:
            record |= _simulate(video, folder, number, frames, file)
        except (NotJoinable, ec.PipelineError) as reason:
            record["problem"] = str(reason)
    events = os.path.join(folder, f"{number}.events")
    os.replace(file.name, events)
    record |= {"size": os.path.getsize(events), "problem": record.get("problem", frames.problem), "times": frames.times,
               "corrupted": frames.corrupted, "shown": frames.shown, "others_end": frames.others_end,
               "before": frames.before, "last": frames.last}
    write_record(os.path.join(folder, f"{number}.json"), record)


def _simulate(video, folder, number, frames, file):
    """Writes to an open file; returns what only the pipeline knows."""
    def state_after(number):
        return os.path.join(folder, f"{number}.state")

    found = {"caps": None}
    more = {"final-state": state_after(number)} if has_state(video) and frames.end is not None else {}
    if has_state(video) and number > 0 and _read(os.path.join(folder, f"{number - 1}.json"))["problem"]:
        raise NotJoinable("the previous clip cannot be joined")
    with video.playing(SINK, threads=1, more=more, filters=False) as pipeline:
        decoders = decoders_of(pipeline)
        pipeline.gaps_as_buffers()
        # A sink pad, after the conversion: its frames begin with their luma.
        frames.watch(pipeline.element("decoded").get_static_pad("src").get_peer())
        if number > 0:
            pipeline.set_state(Gst.State.PAUSED)
            if has_state(video):
                pipeline.first(_simulator(video)).set_property("initial-state", state_after(number - 1))
            pipeline.seek(max(frames.start - MARGIN, 0) / 1e9, None)
        for sample in pipeline.samples():
            buffer = sample.get_buffer()
            if not frames.times or buffer.pts + buffer.duration < frames.times[0]:
                continue  # while it warms up
            _write(file, buffer, number == 0 and buffer.has_flags(Gst.BufferFlags.DISCONT))
            segment = sample.get_segment()
            found = {"caps": sample.get_caps().to_string(),
                     "segment": {field: getattr(segment, field) for field in SEGMENT_FIELDS}}
        found["duration"] = duration_of(pipeline)
    return found | {"decoders": sorted(decoders)}


def _write(file, buffer, is_discontinuous):
    events = buffer.extract_dup(0, buffer.get_size())
    meta = GstEventCamera.buffer_get_event_camera_label_meta(buffer) if events else None
    labels = meta.get_bytes().get_data() if meta else b""
    file.write(HEADER.pack(buffer.pts, buffer.duration, is_discontinuous, len(events), len(labels)))
    file.write(events)
    file.write(labels)


# joining clips


class Clips:
    """All clips of a video, joined. Raises NotJoinable if they are not those of the whole."""

    def __init__(self, video, folder, cuts):
        self._video = video
        self._paths = [os.path.join(folder, f"{number}.events") for number in range(len(cuts) + 1)]
        self._records = [_read(os.path.join(folder, f"{number}.json")) for number in range(len(cuts) + 1)]
        self._check(_origin(video, cuts))
        self.duration = self._records[0]["duration"]
        self.decoders = set().union(*(record["decoders"] for record in self._records))
        self.frames = Frames()
        self.frames.times = [time for record in self._records for time in record["times"]]
        self.frames.corrupted = sum(record["corrupted"] for record in self._records)
        self.frames.shown, self.frames.others_end = self._records[-1]["shown"], self._records[-1]["others_end"]
        if np.any(np.diff(np.array(self.frames.times, np.int64)) <= 0):
            raise NotJoinable("the times of its frames do not increase")

    def _check(self, origin):
        for number, record in enumerate(self._records):
            if record["of"] != origin:
                raise NotJoinable("the input has changed")
            if record["problem"]:
                raise NotJoinable(record["problem"])
            if not os.path.exists(self._paths[number]) or os.path.getsize(self._paths[number]) != record["size"]:
                raise NotJoinable(f"the events of clip {number} are missing or cut off")
            if record["caps"] != self._records[0]["caps"] or not record["times"]:
                raise NotJoinable(f"clip {number} has no events of the same caps")
        for before, after in zip(self._records, self._records[1:]):
            seen = after["before"][1:]
            if len(seen) < MIN_MARGIN - 1:
                raise NotJoinable(f"a second of it has fewer than {MIN_MARGIN} frames")
            if seen != before["last"][-len(seen):]:
                raise NotJoinable("a seek leads to other frames")

    @contextlib.contextmanager
    def playing(self, rest):
        """A pipeline in which the elements `rest` take the filtered events."""
        filters = self._video.recipe.filters or "identity"
        with Pipeline("appsrc name=clips format=time handle-segment-change=true ! identity"
                      f" ! {filters} ! identity ! {EVENT_CAPS} ! {rest}") as pipeline:
            source = pipeline.element("clips")
            source.get_static_pad("src").add_probe(Gst.PadProbeType.BUFFER, _replace_by_gap)
            samples = self._samples()

            def push(*_):
                sample = next(samples, None)
                if sample:
                    source.push_sample(sample)
                else:
                    source.end_of_stream()

            source.connect("need-data", push)
            yield pipeline

    def _samples(self):
        caps = Gst.Caps.from_string(self._records[0]["caps"])
        segment = Gst.Segment()
        segment.init(Gst.Format.TIME)
        for field, value in self._records[0]["segment"].items():
            setattr(segment, field, value)
        for path in self._paths:
            with open(path, "rb") as file:
                while header := file.read(HEADER.size):
                    yield Gst.Sample.new(_read_buffer(file, *HEADER.unpack(header)), caps, segment, None)


def _read_buffer(file, pts, duration, is_discontinuous, size, label_size):
    buffer = Gst.Buffer.new_wrapped(file.read(size)) if size > 0 else Gst.Buffer.new()
    buffer.pts, buffer.duration = pts, duration
    if is_discontinuous:
        buffer.set_flags(Gst.BufferFlags.DISCONT)
    if label_size > 0:
        GstEventCamera.buffer_add_event_camera_label_bytes(buffer, GLib.Bytes.new(file.read(label_size)))
    return buffer


def _replace_by_gap(pad, info):
    """An interval without events, which is in the file as an empty buffer."""
    buffer = info.get_buffer()
    if buffer.get_size() > 0:
        return Gst.PadProbeReturn.OK
    pad.push_event(Gst.Event.new_gap(buffer.pts, buffer.duration))
    return Gst.PadProbeReturn.DROP
