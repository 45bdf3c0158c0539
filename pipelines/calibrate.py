#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the thresholds at which a simulator makes as many events of a video as a real camera made
of the same scene, ON and OFF each, and prints them and how alike the two streams then are.

    calibrate.py drive.mp4 drive.raw --element eventsim-dense --to 2

The video may be anything that GStreamer decodes, or a text of lines "seconds picture"; the
recording any file of events that this project reads. Both must have the same pixels and the same
clock. --from and --to count from the first frame; what is not told is all that both cover. With
--measure-from and --measure-to, the streams are compared over that time instead."""
import argparse
import json
import os
import sys
import tempfile
from dataclasses import dataclass

import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
gi.require_version("GstVideo", "1.0")
from gi.repository import GLib, Gst, GstApp, GstVideo  # noqa: E402, F401

XYTP = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])
EVENT = np.dtype([("t", "<i8"), ("x", "<u2"), ("y_p", "<u2")])
ON = 0x8000

# A bracket is narrowed until its ends are this near, and begun anew so often at most.
PRECISION = 1e-3
MOST_ROUNDS = 3
MOST_TRIALS = 60
# How many frames before a stretch of time are played too: pixels have a past.
PAST_FRAMES = 5
# Of eventsim-dvs, the offset of a logarithmic response, as a share of white; how many grey levels of
# a frame may be noise; and how far an exposure's pulse goes, as a share of the threshold.
LOG_OFFSETS = [0.0025, 0.0035, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.057, 0.08, 0.11, 0.16]
COARSELY = 2
DENOISE = [0, 2, 4, 8, 12]
PULSES = [0, 0.04, 0.08, 0.12, 0.16, 0.24]


# What simulators read where it lies: the luma of a decoder is left as it is.
LUMA = "video/x-raw,format=(string){GRAY8,I420,YV12,NV12,NV21,Y42B,Y444,GRAY16_LE}"


@dataclass
class Frame:
    time: int  # ns
    buffer: Gst.Buffer


@dataclass
class Video:
    caps: str
    width: int
    height: int
    frames: list
    origin: int = 0  # the time of its first frame, which need not be among these, ns

    def luma(self, frame):
        info = GstVideo.VideoInfo.new_from_caps(Gst.Caps.from_string(self.caps))
        depth = np.uint8 if info.finfo.depth[0] == 8 else np.dtype("<u2")
        plane = np.frombuffer(frame.buffer.extract_dup(0, info.stride[0] * self.height), depth)
        grey = plane.reshape(self.height, -1)[:, :self.width].astype(float)
        return grey if info.finfo.depth[0] == 8 else grey / 257


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


class Progress:
    """A line that is written over, on a terminal; in a log, one for each step."""

    def __init__(self, quiet=False):
        self.quiet = quiet
        self.terminal = sys.stderr.isatty()

    def tell(self, text):
        if not self.quiet:
            print(f"\r{text:<78}" if self.terminal else text, end="" if self.terminal else "\n",
                  file=sys.stderr, flush=True)

    def end(self):
        if self.terminal and not self.quiet:
            print(file=sys.stderr)


# pipelines


def run(launch, feeds=(), take=None):
    """Plays a pipeline. Each feed is the name of an appsrc, its caps and its buffers; take(sample)
    gets what comes to the appsink `out`."""
    pipeline = Gst.parse_launch(launch)
    unsuitable = []
    if decoder := pipeline.get_by_name("decoder"):
        decoded = pipeline.get_by_name("decoded").get_static_pad("sink")
        decoder.connect("no-more-pads", lambda _: decoded.is_linked() or unsuitable.append(True))
    try:
        for name, caps, _ in feeds:
            pipeline.get_by_name(name).set_property("caps", Gst.Caps.from_string(caps))
        pipeline.set_state(Gst.State.PLAYING)
        for name, _, buffers in feeds:
            source = pipeline.get_by_name(name)
            for buffer in buffers:
                source.push_buffer(buffer)
            source.end_of_stream()
        sink = pipeline.get_by_name("out")
        bus = pipeline.get_bus()
        while not sink.is_eos():
            if sample := sink.try_pull_sample(Gst.SECOND // 5):
                if take is not None:
                    take(sample)
            elif message := bus.pop_filtered(Gst.MessageType.ERROR):
                error, _ = message.parse_error()
                raise RuntimeError(f"{message.src.get_name()}: {error.message}")
            elif unsuitable:
                raise RuntimeError(f"nothing suitable is in it: {launch.split(' ! ')[0]}")
        if message := bus.pop_filtered(Gst.MessageType.ERROR):
            raise RuntimeError(message.parse_error()[0].message)
    finally:
        pipeline.set_state(Gst.State.NULL)


def quoted(path):
    return '"' + path.replace("\\", "\\\\").replace('"', '\\"') + '"'


def buffer_of(data, time, duration=None):
    buffer = Gst.Buffer.new_wrapped(data)
    buffer.pts = time
    if duration is not None:
        buffer.duration = duration
    return buffer


def events_of(buffer):
    """The events of a buffer, with their whole times."""
    packed = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), XYTP)
    events = np.empty(len(packed), EVENT)
    events["t"] = buffer.pts // 1000 + packed["t"].astype("<i8")
    events["x"] = packed["x"]
    events["y_p"] = packed["y_p"]
    return events


def joined(parts):
    return np.concatenate(parts) if parts else np.empty(0, EVENT)


# what is read


def read_pictures(path, start, end):
    """A text of lines "seconds picture"; nothing where it is none."""
    entries = []
    try:
        with open(path, encoding="utf-8") as file:
            for line in file:
                if line.strip() and not line.startswith("#"):
                    seconds, name = line.split(maxsplit=1)
                    entries.append((round(float(seconds) * 1e9),
                                    os.path.join(os.path.dirname(path), name.strip())))
    except (UnicodeDecodeError, ValueError):
        return None
    times = [time for time, _ in entries]
    start, end = (time + times[0] for time in (start, end))
    first = max([i for i, time in enumerate(times) if time <= start], default=0)
    first = max(first - PAST_FRAMES, 0)
    last = min([i for i, time in enumerate(times) if time >= end], default=len(times) - 1)
    video = None
    for time, picture in entries[first:last + 1]:
        part = decode(picture, 0, 0)
        video = video or Video(part.caps, part.width, part.height, [], times[0])
        if part.caps != video.caps:
            raise RuntimeError(f"{picture} has another size or format than the pictures before")
        video.frames.append(Frame(time, part.frames[0].buffer))
    return video


def decode(path, start, end):
    """The frames that lie around a stretch of time, and a few before it."""
    video = Video("", 0, 0, [])

    def take(sample):
        if not video.frames:
            video.caps = sample.get_caps().to_string()
            info = sample.get_caps().get_structure(0)
            video.width, video.height = info.get_value("width"), info.get_value("height")
            video.origin = sample.get_buffer().pts
        buffer = sample.get_buffer()
        if video.frames and video.frames[-1].time - video.origin >= end > 0:
            return
        if buffer.pts - video.origin <= start:
            del video.frames[:-PAST_FRAMES]
        # A decoder waits for what it has lent.
        video.frames.append(Frame(buffer.pts, buffer.copy_deep()))

    run(f"filesrc location={quoted(path)} ! decodebin name=decoder"
        f"  decoder. ! videoconvert name=decoded ! {LUMA}"
        " ! appsink name=out sync=false max-buffers=4", take=take)
    if not video.frames:
        raise RuntimeError(f"{path}: no pictures")
    return video


def read_video(path, start, end):
    """The frames from a few before `start` to the first one at or after `end`, in seconds after
    the first one of all."""
    start, end = start * 1e9, end * 1e9
    return read_pictures(path, start, end) or decode(path, start, end)


def read_recording(path, video):
    """All events of a file."""
    parts = []

    def take(sample):
        info = sample.get_caps().get_structure(0)
        width, height = info.get_value("width"), info.get_value("height")
        if width > video.width or height > video.height:
            raise RuntimeError(f"{path} has {width} x {height} pixels, the video has"
                               f" {video.width} x {video.height}")
        parts.append(events_of(sample.get_buffer()))

    reader = "decodebin caps=application/x-event-camera name=decoder  decoder. ! identity"
    if os.path.splitext(path)[1].lower() in (".csv", ".txt"):
        # Lines do not say how large the sensor is, so it is asked for.
        reader = (f"eventcsvdec ! application/x-event-camera,width={video.width},height={video.height}"
                  " ! identity")
    run(f"filesrc location={quoted(path)} ! {reader} name=decoded ! application/x-event-camera"
        " ! appsink name=out sync=false max-buffers=4", take=take)
    return joined(parts)


# what is simulated and compared


def simulate(video, element):
    """The events that an element, with its properties, makes of a video."""
    parts = []
    buffers = []
    # A lag may put frames before 0, where no buffer can be.
    origin = -min(video.frames[0].time // 1000, 0)
    for frame in video.frames:
        # copy() would be another name of the same buffer.
        buffer = frame.buffer.copy_region(
            Gst.BufferCopyFlags.MEMORY | Gst.BufferCopyFlags.META, 0, frame.buffer.get_size())
        buffer.pts = frame.time + origin * 1000
        buffers.append(buffer)
    run(f"appsrc name=frames format=time ! {element} ! application/x-event-camera"
        " ! appsink name=out sync=false", [("frames", video.caps, buffers)],
        lambda sample: parts.append(events_of(sample.get_buffer())))
    events = joined(parts)
    events["t"] -= origin
    return events


def compare(video, recorded, simulated, span, picture=None):
    """The figures of eventcompare over a stretch of time."""
    def buffers(events):
        part = span.of(events)
        packed = np.empty(len(part), XYTP)
        packed["t"] = part["t"] - span.start
        packed["x"], packed["y_p"] = part["x"], part["y_p"]
        return [buffer_of(packed.tobytes(), span.start * 1000, (span.end - span.start) * 1000)]

    caps = (f"application/x-event-camera,format=XYTP,width={video.width},height={video.height},"
            "framerate=0/1")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "figures.json")
        drawn = f" map={quoted(picture)}" if picture else ""
        run(f"eventcompare name=compare location={quoted(path)}{drawn}"
            " ! appsink name=out sync=false"
            "  appsrc name=recorded format=time ! compare.reference"
            "  appsrc name=simulated format=time ! compare.candidate",
            [("recorded", caps, buffers(recorded)), ("simulated", caps, buffers(simulated))])
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def counts(events):
    on = np.count_nonzero(events["y_p"] & ON)
    return np.array([on, len(events) - on], float)


def with_thresholds(element, thresholds):
    positive, negative = thresholds
    return f"{element} positive-threshold={positive:.6g} negative-threshold={negative:.6g}"


def threshold_limits(element):
    """The least and the greatest threshold of an element."""
    made = Gst.ElementFactory.make(element.split()[0])
    if made is None:
        raise RuntimeError(f"there is no element \"{element.split()[0]}\"")
    spec = made.find_property("positive-threshold")
    if spec is None:
        raise RuntimeError(f"\"{element}\" has no thresholds")
    return spec.minimum, spec.maximum, spec.default_value


def find_thresholds(video, recorded, span, element, progress):
    """The thresholds at which the simulator's ON and OFF events within the span are as many as the
    recording's, by bisection of both at once."""
    goal = counts(span.of(recorded))
    if goal.min() == 0:
        raise RuntimeError("the recording has no events, or of one polarity only")
    least, most, default = threshold_limits(element)
    least = max(least, default / 100)
    low = np.full(2, least)
    high = np.full(2, min(most, default * 20))
    each, each_error = np.full(2, default), np.full(2, np.inf)
    best, best_error = np.full(2, default), np.full(2, np.inf)
    rounds = 0
    for trial in range(MOST_TRIALS):
        closed = (high / low < 1 + PRECISION).all()
        thresholds = each.copy() if closed else np.sqrt(low * high)
        made = counts(span.of(simulate(video, with_thresholds(element, thresholds))))
        error = np.abs(np.log(np.maximum(made, 0.5) / goal))
        progress.tell(f"{element}: trial {trial + 1}, thresholds {thresholds[0]:.4g} and"
                      f" {thresholds[1]:.4g}, {made[0] / goal[0]:.3f} of the ON and"
                      f" {made[1] / goal[1]:.3f} of the OFF events")
        each = np.where(error < each_error, thresholds, each)
        each_error = np.minimum(error, each_error)
        if error.sum() < best_error.sum():
            best, best_error = thresholds, error
        if error.max() < PRECISION:
            break
        if closed:
            # The best of either need not be the best together: where one fires, the other's memory
            # changes.
            rounds += 1
            if best_error.max() < 0.01 or rounds == MOST_ROUNDS:
                break
            low, high = np.maximum(best / 1.3, least), np.minimum(best * 1.3, most)
            each, each_error = best, best_error
        else:
            more = made > goal
            low, high = np.where(more, thresholds, low), np.where(more, high, thresholds)
    return best


def likeness(figures):
    """How alike two streams are: the mean of the map correlation and of the shares of events that
    have a partner, within 1, 5 and 10 ms, on both sides."""
    shares = [figures[f"{side}-partners"][distance] for side in ("reference", "candidate")
              for distance in ("within-1ms", "within-5ms", "within-10ms")]
    return float(np.mean([figures["map-correlation"], *shares]))


class Choices:
    """What else of an element is to be chosen than its thresholds, and how well it does then."""

    def __init__(self, video, recorded, span, element, progress):
        self.video, self.recorded, self.span = video, recorded, span
        self.element, self.progress = element, progress
        self.tried = {}

    def is_free(self, name):
        made = Gst.ElementFactory.make(self.element.split()[0])
        return (made is not None and made.find_property(name) is not None
                and f"{name}=" not in self.element)

    def with_properties(self, chosen):
        return " ".join([self.element] + [f"{name}={value:g}" if isinstance(value, float)
                                          else f"{name}={value}" for name, value in chosen.items()])

    def calibrated(self, chosen):
        """With the thresholds that suit the recording, and how alike the streams are then."""
        element = self.with_properties(chosen)
        if element not in self.tried:
            thresholds = find_thresholds(self.video, self.recorded, self.span, element,
                                         self.progress)
            found = with_thresholds(element, thresholds)
            figures = compare(self.video, self.recorded, simulate(self.video, found), self.span)
            self.tried[element] = likeness(figures), thresholds, found
            self.progress.tell(f"{found}: likeness {likeness(figures):.4f}")
        return self.tried[element]

    def best_response(self):
        """Coarsely, of the offset."""
        if not self.is_free("response"):
            return {}
        made = Gst.ElementFactory.make(self.element.split()[0])
        choices = []
        for response in made.find_property("response").enum_class.__enum_values__.values():
            if response.value_nick == "log" and self.is_free("log-eps"):
                choices += [{"response": "log", "log-eps": offset}
                            for offset in LOG_OFFSETS[::COARSELY]]
            else:
                choices.append({"response": response.value_nick})
        return max(choices, key=lambda chosen: self.calibrated(chosen)[0])

    def climb(self, chosen, axes):
        """From value to neighbouring value, as long as that makes the streams more alike."""
        improved = True
        while improved:
            improved = False
            for name, values in axes.items():
                for step in (1, -1):
                    while True:
                        i = values.index(chosen[name]) + step
                        if not 0 <= i < len(values):
                            break
                        other = chosen | {name: values[i]}
                        if self.calibrated(other)[0] <= self.calibrated(chosen)[0]:
                            break
                        chosen, improved = other, True
        return chosen


def calibrate(video, recorded, span, element, progress):
    """The element with the thresholds that suit the recording, and for eventsim-dvs with the
    response and its offset, denoising, and the pulse of exposures, where the recording has one."""
    choices = Choices(video, recorded, span, element, progress)
    chosen = choices.best_response()
    axes = {}
    if "log-eps" in chosen:
        axes["log-eps"] = LOG_OFFSETS
    if choices.is_free("denoise"):
        chosen, axes["denoise"] = chosen | {"denoise": 0}, DENOISE
    if choices.is_free("exposure-pulse") and choices.is_free("exposure-lead"):
        lead = find_exposure_lead(video, recorded, span)
        if lead is not None:
            threshold = choices.calibrated(chosen)[1][0]
            chosen |= {"exposure-lead": lead, "exposure-pulse": 0.0}
            axes["exposure-pulse"] = [share * threshold for share in PULSES]
    if not axes and not chosen:
        return with_thresholds(element, find_thresholds(video, recorded, span, element, progress))
    return choices.calibrated(choices.climb(chosen, axes))[2]


def find_exposure_lead(video, recorded, span):
    """How long before a frame's time its exposure begins, in microseconds, if that shows in the
    recording: the camera then fires ON all over the picture, within a fraction of a millisecond."""
    times = np.array([frame.time for frame in video.frames]) // 1000
    on = recorded["t"][(recorded["y_p"] & ON) != 0]
    seen = [(frame, on[(on > before) & (on <= frame)])
            for before, frame in zip(times, times[1:])
            if before >= min(span.start, recorded["t"][0]) and frame <= span.end]
    if not seen:
        return None
    width = 100
    longest = max(frame - before for before, frame in zip(times, times[1:]))
    leads = np.concatenate([frame - events for frame, events in seen])
    counts, edges = np.histogram(leads, np.arange(0, longest + width, width))
    burst = int(np.argmax(counts))
    if counts[burst] < 50 * len(seen) or counts[burst] < 10 * np.median(counts):
        return None
    # It begins where there are events in plenty first, which is the longest lead.
    while burst + 1 < len(counts) and counts[burst + 1] > counts.max() / 4:
        burst += 1
    return int(edges[burst + 1])


def find_lag(video, recorded):
    """How much later than its time a frame shows the world, in seconds, to begin with: a frame's
    time may be the beginning of its exposure. At the lag sought, the signs of a pixel's events
    between two frames tell best how its brightness has changed."""
    times = np.array([frame.time for frame in video.frames]) / 1000
    greys = [np.log(video.luma(frame).ravel() + 10) for frame in video.frames]
    changes = [after - before for before, after in zip(greys, greys[1:])]
    place = (recorded["y_p"] & 0x7FFF).astype(np.int64) * video.width + recorded["x"]
    sign = np.where(recorded["y_p"] & ON, 1.0, -1.0)
    spacing = np.median(np.diff(times))

    def agreement(lag):
        found = []
        for change, start, end in zip(changes, times + lag, times[1:] + lag):
            if start < recorded["t"][0] - spacing / 4 or end > recorded["t"][-1] + spacing / 4:
                continue
            first, last = np.searchsorted(recorded["t"], [start, end], side="right")
            signs = np.bincount(place[first:last], sign[first:last], len(change))
            if signs.std() > 0 and change.std() > 0:
                found.append(np.corrcoef(signs, change)[0, 1])
        return np.mean(found) if found else -1

    lags = np.linspace(-spacing / 2, spacing / 2, 81)
    return float(max(lags, key=agreement)) / 1e6


def refine_lag(video, recorded, span, element, progress):
    """How much more, in seconds, where a simulator can tell: a pixel fires only when it has changed
    by a threshold, so the signs alone find frames too late. `video` and `span` have the lag that
    was found to begin with."""
    spacing = np.median(np.diff([frame.time for frame in video.frames])) / 1e9

    def likeness(more):
        figures = compare(video, recorded, simulate(delayed(video, more), element),
                          Span(span.start + round(more * 1e6), span.end + round(more * 1e6)))
        progress.tell(f"frames {1000 * more:+.1f} ms later: map correlation"
                      f" {figures['map-correlation']:.3f}")
        return figures["map-correlation"]

    return float(max(np.linspace(-spacing / 6, spacing / 6, 13), key=likeness))


# the program


def describe(name, figures):
    shares = " ".join(
        f"{figures[side + '-partners'][distance]:.3f}" for side in ("reference", "candidate")
        for distance in ("within-1ms", "within-5ms", "within-10ms"))
    real, ours = figures["reference"], figures["candidate"]
    return "\n".join([
        f"{name}",
        f"  events           {real['events']:>12} recorded {ours['events']:>12} simulated",
        f"  mean             {real['mean']:>12.4f} recorded {ours['mean']:>12.4f} simulated"
        "   events per pixel and second",
        f"  deviation        {real['deviation']:>12.4f} recorded {ours['deviation']:>12.4f}"
        " simulated",
        f"  share of ON      {real['on-share']:>12.3f} recorded {ours['on-share']:>12.3f}"
        " simulated",
        f"  map correlation  {figures['map-correlation']:>12.3f}",
        f"  partners within 1, 5, 10 ms of the recorded, of the simulated: {shares}"])


def options():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video")
    parser.add_argument("recording")
    parser.add_argument("--element", default="eventsim-dense",
                        help="a simulator, with properties if you like")
    for name, what in (("from", "where calibrating begins"), ("to", "and ends"),
                       ("measure-from", "where comparing begins"), ("measure-to", "and ends")):
        parser.add_argument("--" + name, type=float, metavar="SECONDS", help=what)
    parser.add_argument("--lag", default="0", metavar="SECONDS|find",
                        help="how much later than its time a frame shows the world")
    parser.add_argument("--map", metavar="PNG", help="writes a picture of the events of each pixel")
    return parser.parse_args()


def span_of(video, recorded, lag, start, end):
    """From `start` to `end`, after the video's first frame; where nothing is said what both cover."""
    latest_start = max(video.frames[0].time // 1000, int(recorded["t"][0]) - 1)
    earliest_end = min(video.frames[-1].time // 1000, int(recorded["t"][-1]))
    origin = video.origin // 1000
    span = Span(latest_start if start is None else origin + round((start + lag) * 1e6),
                earliest_end if end is None else origin + round((end + lag) * 1e6))
    if span.end <= span.start:
        raise RuntimeError("the video and the recording have no time in common")
    return span


def until(video, end):
    """A video up to the first frame at or after `end`, in microseconds."""
    frames = [frame for i, frame in enumerate(video.frames)
              if i == 0 or video.frames[i - 1].time < end * 1000]
    return Video(video.caps, video.width, video.height, frames, video.origin)


def delayed(video, seconds):
    return Video(video.caps, video.width, video.height,
                 [Frame(frame.time + round(seconds * 1e9), frame.buffer) for frame in video.frames],
                 video.origin)


def main():
    chosen = options()
    progress = Progress()
    Gst.init(None)
    start = getattr(chosen, "from")
    ends = [end for end in (chosen.to, chosen.measure_to) if end is not None]
    progress.tell(f"reading {chosen.video}")
    video = read_video(chosen.video, start or 0, max(ends) if len(ends) else float("inf"))
    if len(video.frames) < 2:
        raise RuntimeError(f"{chosen.video}: no two frames")
    progress.tell(f"reading {chosen.recording}")
    recorded = read_recording(chosen.recording, video)
    if len(recorded) == 0:
        raise RuntimeError(f"{chosen.recording}: no events")
    progress.end()
    lag = 0 if chosen.lag == "find" else float(chosen.lag)
    if chosen.lag == "find":
        seen = video if chosen.to is None else until(video, video.origin // 1000 + round(chosen.to * 1e6))
        lag = find_lag(seen, recorded)
    video = delayed(video, lag)
    span = span_of(video, recorded, lag, start, chosen.to)
    element = calibrate(until(video, span.end), recorded, span, chosen.element, progress)
    progress.end()
    measured = span
    if chosen.measure_from is not None or chosen.measure_to is not None:
        measured = span_of(video, recorded, lag, chosen.measure_from, chosen.measure_to)
    figures = compare(video, recorded, simulate(video, element), measured, chosen.map)
    if lag != 0:
        print(f"A frame shows the world {lag * 1000:.1f} ms later than its time.")
    print(describe(element, figures))


if __name__ == "__main__":
    try:
        main()
    except (RuntimeError, OSError, GLib.Error) as failure:
        sys.exit(f"error: {failure}")
