#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the contrast thresholds at which a simulator generates as many ON and OFF events from a
video as a real camera recorded of the same scene. For eventsim-dvs it also finds response, upsampling,
denoising, adaptation, threshold jitter, refractory period and exposure pulses, and balances the errors of
mean and standard deviation over the pixels. Prints the settings, and how similar the two streams are.
Overexposed parts of the frames are excluded.

    event-calibrate drive.mp4 drive.raw --profile camera.profile --to 2

VIDEO is anything that GStreamer decodes, or a text file of lines "seconds picture"; RECORDING is
any event file that this project reads. Both need the same pixels and the same clock. --from and
--to are in seconds after the first frame; the default is the time that both cover. --measure-from
and --measure-to select another time for the comparison."""
import argparse
import functools
import os
import sys
import time
from statistics import harmonic_mean

# Imported first: it reports missing packages.
from event_streams import (GLib, Gst, Span, compare, delayed, expect_writable, read_mask, read_recording,
                           read_video, seconds, simulate, until)
import numpy as np
from plugins import find_plugins
from threshold_search import ROUGH_PRECISION, Setting, find_thresholds

# Parts of the calibrated time for cross-validation.
PARTS = 4
# Values tried for eventsim-dvs: the response to the frames, with the offset of a logarithmic one as a share of white;
# and stages of the pixel.
RESPONSE = {
    "log-eps": [0.001, 0.0018, 0.0025, 0.0035, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.057, 0.08, 0.11, 0.16,
                0.22, 0.32],
    "overexposed-light": [1, 1.25, 1.5, 2, 3, 4, 6],
    "response": ["linear", "log", "lin-log"],
    "linear-light": ["false", "true"],
    "exposure-compensation": ["false", "true"],
}
# Exposure compensation changes nothing while the exposure is constant, and the exposure may change later.
FIRST_RESPONSE = {"log-eps": 0.02, "overexposed-light": 1, "response": "log", "linear-light": "false",
                  "exposure-compensation": "true"}
UPSAMPLING = ["linear", "motion"]
STAGES = {
    "denoise": [0, 2, 4, 8, 12],
    "adaptation": [0, 0.05, 0.1, 0.2, 0.3, 0.4],
    "refractory-period": [0, 300_000, 600_000, 1_000_000, 2_000_000],
}
# Stages in units of the response, as shares of the mean threshold.
RELATIVE_STAGES = {
    "threshold-jitter": [0, 0.1, 0.2, 0.3, 0.4],
    "exposure-pulse": [0, 0.04, 0.08, 0.12, 0.16, 0.24],
}
# Their first value turns them off; it is chosen if they improve the likeness by less than MIN_GAIN.
OPTIONAL = {"overexposed-light", *STAGES, *RELATIVE_STAGES}
MIN_GAIN = 0.002
# Maximum factor between the numbers of events, when mean and standard deviation are balanced.
MAX_BALANCE = 1.1
# The element that has profiles.
PROFILED = "eventsim-dvs"


def likeness(figures):
    """Similarity of two streams, from 0 to 1: the mean of the map correlation, the harmonic means of the shares of
    recorded and of simulated events that have a match within 1, 5 and 10 ms, which count twice, the ratio of the
    variances over the pixels, and the ratio between the times from event to event. A harmonic mean is close to the
    smaller share, so a simulator cannot trade one share for the other."""
    def both(limit):
        return harmonic_mean([figures[f"{side}-matches"][f"within-{limit}ms"] for side in ("reference", "candidate")])

    deviations = sorted(figures[side]["std-dev"] for side in ("reference", "candidate"))
    return float(np.average([figures["map-correlation"], both(1), both(5), both(10),
                             (deviations[0] / deviations[1]) ** 2, 10 ** -figures["interval-distance"]],
                            weights=[1, 2, 2, 2, 1, 1]))


class Progress:
    """Prints progress: one line, overwritten, on a terminal; a line per step elsewhere."""

    def __init__(self):
        self.on_terminal = sys.stderr.isatty()

    def tell(self, text):
        print(f"\r{text:<78}" if self.on_terminal else text, end="" if self.on_terminal else "\n", file=sys.stderr,
              flush=True)

    def end(self):
        if self.on_terminal:
            print(file=sys.stderr)


class Choices:
    """Tries property values and rates them by cross-validation: each part of a stream is simulated with
    thresholds that fit the other parts; the likeness of the stream is the rating."""

    def __init__(self, video, recorded, span, element, progress):
        self.video, self.recorded, self.span = video, recorded, span
        self.element, self.progress = element, progress
        self.made = Gst.ElementFactory.make(element.split()[0])
        self.parts = parts_of(video, span)
        # The last stream of a threshold search is rated.
        self.simulated_by = functools.lru_cache(maxsize=4)(functools.partial(simulate, video))
        self.rated = {}
        self.thresholds = None  # of the last setting, the first guess for the next one
        self.began = time.monotonic()
        self.expected = 0

    def is_free(self, name):
        return (self.made is not None and self.made.find_property(name) is not None
                and f"{name}=" not in self.element)

    def setting(self, chosen):
        chosen = dict(chosen)
        if chosen.get("response", "log") != "log":
            chosen.pop("log-eps", None)
        for name, default in (("overexposed-light", 1), ("linear-light", "false"), ("exposure-compensation", "false")):
            if chosen.get(name) == default:
                del chosen[name]
        if chosen.get("refractory-period") == 0:
            del chosen["refractory-period"]
        elif "refractory-period" in chosen and self.is_free("refractory-reset"):
            chosen["refractory-reset"] = "signal"
        shares = {name: chosen.pop(name) for name in RELATIVE_STAGES if name in chosen}
        values = [f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
                  for name, value in chosen.items()]
        return Setting(" ".join([self.element, *values]), shares)

    def rating(self, chosen):
        """The likeness by cross-validation."""
        return self.rated_by(chosen, self.parts)

    def rough_rating(self, chosen):
        """The likeness without cross-validation."""
        return self.rated_by(chosen, [self.span])

    def rated_by(self, chosen, parts):
        setting = self.setting(chosen)
        key = str(setting), len(parts)
        if key not in self.rated:
            simulated = np.concatenate([self.predicted(part, parts, setting) for part in parts])
            self.rated[key] = likeness(compare(self.video, self.recorded, simulated, self.span))
            self.tell_progress(f"{setting}: likeness {self.rated[key]:.4f}")
        return self.rated[key]

    def predicted(self, part, parts, setting):
        """The simulated events of a part, with thresholds that fit the other parts, or itself if it is the only
        one."""
        others = [other for other in parts if other is not part] or [part]
        self.thresholds = find_thresholds(self.simulated_by, self.recorded, others, setting, self.progress,
                                          self.thresholds, ROUGH_PRECISION)
        return part.of(self.simulated_by(setting.with_thresholds(self.thresholds)))

    def calibrated(self, chosen, share=1.0):
        """The element with thresholds that fit the whole span, or this share of its events."""
        setting = self.setting(chosen)
        self.thresholds = find_thresholds(self.simulated_by, self.recorded, self.parts, setting, self.progress,
                                          self.thresholds, share=share)
        return setting.with_thresholds(self.thresholds)

    def balanced(self, chosen):
        """The element with thresholds that balance the errors of the mean event rate and of its standard deviation
        over the pixels: one is too small by the factor that the other is too large."""
        figures = compare(self.video, self.recorded, self.simulated_by(self.calibrated(chosen)), self.span)
        mean, deviation = (figures["candidate"][field] / figures["reference"][field] for field in ("mean", "std-dev"))
        return self.calibrated(chosen, np.clip(np.sqrt(mean / deviation), 1 / MAX_BALANCE, MAX_BALANCE))

    def best_response(self):
        """The best response with motion, and the values of its free properties."""
        axes = {name: values for name, values in RESPONSE.items() if self.is_free(name)}
        if "response" not in axes and "response=log" not in self.element.split():
            axes.pop("log-eps", None)
        if not any(self.video.overexposed(frame).any() for frame in self.video.frames):
            axes.pop("overexposed-light", None)
        start = {"upsampling": "motion"} if self.is_free("upsampling") else {}
        start |= {name: FIRST_RESPONSE[name] for name in axes}
        starts = [start | {"linear-light": light} for light in axes.get("linear-light", [])] or [start]
        climbed = [self.climb(start, axes, self.rough_rating) for start in starts]
        return max(climbed, key=self.rough_rating) if len(climbed) > 1 else climbed[0], axes

    def climb(self, chosen, axes, rating):
        """Hill climbing: steps to neighbouring values while that improves the rating."""
        self.expected += 4 * len(axes)  # two passes
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
                        if rating(other) <= rating(chosen):
                            break
                        chosen, improved = other, True
        return chosen

    def pruned(self, chosen, axes):
        """`chosen` without the OPTIONAL stages that improve nothing."""
        for name in filter(OPTIONAL.__contains__, axes):
            without = chosen | {name: axes[name][0]}
            if self.rating(without) > self.rating(chosen) - MIN_GAIN:
                chosen = without
        return chosen

    def tell_progress(self, text):
        done = len(self.rated)
        left = max(self.expected - done, 1) * (time.monotonic() - self.began) / done
        self.progress.tell(f"{text}; {done} settings, about {left // 60:.0f}:{left % 60:02.0f} left")


def parts_of(video, span):
    """A span cut at the frames closest to its quarters."""
    inside = [frame.time // 1000 for frame in video.frames if span.start < frame.time // 1000 < span.end]
    quarters = [span.start + (span.end - span.start) * i / PARTS for i in range(1, PARTS)]
    cuts = sorted({min(inside, key=lambda time: abs(time - quarter)) for quarter in quarters if inside})
    return [Span(start, end) for start, end in zip([span.start, *cuts], [*cuts, span.end])]


def calibrate(video, recorded, span, element, progress):
    """The element with calibrated thresholds; for eventsim-dvs also with a response and its offset,
    denoising, adaptation, threshold jitter, refractory period, upsampling, and exposure pulses if the
    recording shows any."""
    choices = Choices(video, recorded, span, element, progress)
    chosen, axes = choices.best_response()
    if choices.is_free("upsampling"):
        axes["upsampling"] = UPSAMPLING
    stages = {name: values for name, values in (STAGES | RELATIVE_STAGES).items() if choices.is_free(name)}
    if "exposure-pulse" in stages:
        lead = find_exposure_lead(video, recorded, span) if choices.is_free("exposure-lead") else None
        if lead is None:
            del stages["exposure-pulse"]
        else:
            chosen |= {"exposure-lead": lead}
    if not axes | stages:
        return choices.calibrated(chosen)
    # Start without any stage and with all of them, since they depend on each other.
    starts = [chosen | {name: values[i] for name, values in stages.items()} for i in (0, 2)]
    climbed = (choices.climb(start, axes | stages, choices.rating) for start in starts)
    best = choices.pruned(max(climbed, key=choices.rating), axes | stages)
    if best.get("exposure-pulse") == 0:
        best.pop("exposure-lead", None)
    return choices.balanced(best)


def fit_thresholds(video, recorded, span, element, progress):
    """The element with calibrated thresholds, and otherwise unchanged."""
    setting = Setting(element)
    simulated_by = functools.partial(simulate, video)
    return setting.with_thresholds(find_thresholds(simulated_by, recorded, [span], setting, progress))


def find_exposure_lead(video, recorded, span):
    """The time from the start of an exposure to the frame's timestamp, in nanoseconds, if the
    recording shows it: a burst of ON events all over the sensor within a fraction of a
    millisecond."""
    times = np.array([frame.time for frame in video.frames]) // 1000
    on = recorded["t"][recorded["p"]]
    seen = [(frame, on[(on > before) & (on <= frame)])
            for before, frame in zip(times, times[1:])
            if before >= min(span.start, recorded["t"][0]) and frame <= span.end]
    if not seen:
        return None
    width = 100
    max_interval = max(frame - before for before, frame in zip(times, times[1:]))
    leads = np.concatenate([frame - events for frame, events in seen])
    heights, edges = np.histogram(leads, np.arange(0, max_interval + width, width))
    burst = int(np.argmax(heights))
    if heights[burst] < 50 * len(seen) or heights[burst] < 10 * np.median(heights):
        return None
    # The burst starts with its earliest events, which have the longest lead.
    while burst + 1 < len(heights) and heights[burst + 1] > heights.max() / 4:
        burst += 1
    return int(edges[burst + 1]) * 1000


def lag_of_polarities(video, recorded):
    """The lag, in seconds, at which the polarities of a pixel's events between two frames agree best with
    its change of brightness."""
    times = np.array([frame.time for frame in video.frames]) / 1000
    greys = [np.log(video.luma(frame).ravel() + 10) for frame in video.frames]
    changes = [after - before for before, after in zip(greys, greys[1:])]
    pixels = video.pixels_of(recorded)
    sign = np.where(recorded["p"], 1.0, -1.0)
    spacing = np.median(np.diff(times))

    def agreement(lag):
        found = []
        for change, start, end in zip(changes, times + lag, times[1:] + lag):
            if start < recorded["t"][0] - spacing / 4 or end > recorded["t"][-1] + spacing / 4:
                continue
            first, last = np.searchsorted(recorded["t"], [start, end], side="right")
            signs = np.bincount(pixels[first:last], sign[first:last], len(change))
            if signs.std() > 0 and change.std() > 0:
                found.append(np.corrcoef(signs, change)[0, 1])
        return np.mean(found) if found else -1

    lags = np.linspace(-spacing / 2, spacing / 2, 81)
    return float(max(lags, key=agreement)) / 1e6


def find_lag(video, recorded, span, element, progress):
    """The lag: the time, in seconds, from a frame's timestamp, which may be the start of its exposure, to
    the moment that it shows. Polarities alone overestimate it, since a pixel fires only after a change by the
    contrast threshold; a simulator corrects the estimate. `span` excludes the lag."""
    def late(lag):
        return delayed(video, lag), Span(span.start + round(lag * 1e6), span.end + round(lag * 1e6))

    lag = lag_of_polarities(video, recorded)
    shown, over = late(lag)
    choices = Choices(shown, shown.visible(recorded), over, element, progress)
    fitted = choices.calibrated(choices.best_response()[0])

    @functools.cache
    def likeness_at(lag):
        shown, over = late(lag)
        rating = likeness(compare(shown, shown.visible(recorded), simulate(shown, fitted), over))
        progress.tell(f"frames {1000 * lag:.1f} ms late: likeness {rating:.4f}")
        return rating

    spacing = np.median(np.diff([frame.time for frame in video.frames])) / 1e9
    for step in (spacing / 32, -spacing / 32):
        while likeness_at(lag + step) > likeness_at(lag):
            lag += step
    return lag


# the program


def describe(name, figures):
    shares = " ".join(
        f"{figures[side + '-matches'][distance]:.3f}" for side in ("reference", "candidate")
        for distance in ("within-1ms", "within-5ms", "within-10ms"))
    real, ours = figures["reference"], figures["candidate"]
    ceiling = figures["noise-ceiling"]
    return "\n".join([
        f"{name}",
        f"  events           {real['events']:>12} recorded {ours['events']:>12} simulated",
        f"  mean             {real['mean']:>12.4f} recorded {ours['mean']:>12.4f} simulated"
        "   events per pixel and second",
        f"  std. deviation   {real['std-dev']:>12.4f} recorded {ours['std-dev']:>12.4f}"
        " simulated",
        f"  share of ON      {real['on-share']:>12.3f} recorded {ours['on-share']:>12.3f}"
        " simulated",
        f"  map correlation  {figures['map-correlation']:>12.3f}   noise ceiling"
        f" {ceiling['map-correlation']:.3f}",
        f"  rate correlation {figures['rate-correlation']:>12.3f}   in bins of 1 ms; noise ceiling"
        f" {ceiling['rate-correlation']:.3f}",
        f"  interval distance{figures['interval-distance']:>12.3f}   decades",
        f"  matches within 1, 5, 10 ms of the recorded, of the simulated: {shares}",
        "  nearest match after "
        + ", ".join(f"{figures[f'{side}-matches']['nearest-distance'] / 1e6:.2f} ms of the {name}"
                    for side, name in (("reference", "recorded"), ("candidate", "simulated")))])


def element_of(text):
    if not text.strip():
        raise argparse.ArgumentTypeError("name a simulator and its properties, such as eventsim-dense")
    return text


def lag_of(text):
    return text if text == "find" else seconds(text, signed=True)


def options():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video")
    parser.add_argument("recording")
    parser.add_argument("--element", type=element_of, default=PROFILED,
                        help=f"a simulator and its properties (default: {PROFILED})")
    for name, what in (("from", "start of the calibration (default: the second frame)"),
                       ("to", "end of the calibration"),
                       ("measure-from", "start of the comparison"),
                       ("measure-to", "end of the comparison")):
        parser.add_argument("--" + name, type=seconds, metavar="SECONDS", help=what)
    parser.add_argument("--lag", type=lag_of, default="find", metavar="SECONDS|find",
                        help="time from the timestamp of a frame to the moment that it shows; \"find\", the"
                        " default, estimates it from two frame intervals or more")
    parser.add_argument("--mask", metavar="PICTURE",
                        help="a picture that is white where pixels of the camera can fire; events elsewhere"
                        " are excluded from both streams")
    parser.add_argument("--profile", metavar="FILE",
                        help="write the settings of eventsim-dvs, for its property profile")
    parser.add_argument("--map", metavar="PNG", help="write a picture of the event counts per pixel")
    parser.add_argument("--version", action="version", version="%(prog)s @VERSION@",
                        help="print the version and exit")
    return parser.parse_args()


def write_profile(path, element, video, recording):
    """Writes the settings of an eventsim-dvs that differ from the defaults."""
    made = Gst.parse_launch(element)
    lines = [f"# Fitted by event-calibrate @VERSION@ to {os.path.basename(recording)} and {os.path.basename(video)}",
             f"[{PROFILED}]"]
    for spec in made.list_properties():
        if spec.owner_type != made.__gtype__ or spec.name in ("preset", "profile", "seed"):
            continue
        value = made.get_property(spec.name)
        if value != spec.default_value:
            text = f"{value:.6g}" if isinstance(value, float) else getattr(value, "value_nick", value)
            lines.append(f"{spec.name}={text}")
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def has_several_intervals(video, end):
    """Whether two frame intervals or more end at `end`, in microseconds, or before."""
    return len(video.frames) > 2 and video.frames[2].time // 1000 <= end


def span_of(video, recorded, lag, start, end):
    """The time from `start` to `end` after the video's first frame. By default the time that both cover, without
    the first of several frame intervals, which warms up the pixels."""
    latest_start = max(video.frames[0].time // 1000, int(recorded["t"][0]) - 1)
    earliest_end = min(video.frames[-1].time // 1000, int(recorded["t"][-1]))
    origin = video.origin // 1000
    end = earliest_end if end is None else origin + round((end + lag) * 1e6)
    if start is not None:
        start = origin + round((start + lag) * 1e6)
    elif has_several_intervals(video, end):
        start = max(video.frames[1].time // 1000, latest_start)
    else:
        start = latest_start
    span = Span(start, end)
    if span.end <= span.start:
        raise RuntimeError(f"nothing to compare from {span.start / 1e6:.3f} to {span.end / 1e6:.3f} s: the video and the"
                           f" recording have both from {latest_start / 1e6:.3f} to {earliest_end / 1e6:.3f} s; they"
                           " need the same clock, and the times of the options must lie within")
    return span


def main():
    Gst.init(None)
    args = options()
    find_plugins()
    if args.profile and args.element.split()[:1] != [PROFILED]:
        raise RuntimeError(f"only {PROFILED} has profiles, {args.element.split()[0]} has none; leave out --profile")
    for path in filter(None, (args.profile, args.map)):
        expect_writable(path, filter(None, (args.video, args.recording, args.mask)))
    progress = Progress()
    start = getattr(args, "from")
    ends = [end for end in (args.to, args.measure_to) if end is not None]
    progress.tell(f"reading {args.video}")
    video = read_video(args.video, start or 0, max(ends) if len(ends) else float("inf"))
    if len(video.frames) < 2:
        raise RuntimeError(f"{args.video}: fewer than two frames")
    progress.tell(f"reading {args.recording}")
    if args.mask:
        video.mask = read_mask(args.mask, video)
    recorded = video.of_camera(read_recording(args.recording, video))
    if len(recorded) == 0:
        raise RuntimeError(f"{args.recording}: no events" + (" where the mask is white" if args.mask else ""))
    progress.end()
    lag = args.lag
    if lag == "find":
        span = span_of(video, recorded, 0, start, args.to)
        is_found = has_several_intervals(video, span.end)
        lag = find_lag(until(video, span.end), recorded, span, args.element, progress) if is_found else 0.0
    video = delayed(video, lag)
    span = span_of(video, recorded, lag, start, args.to)
    measured = span
    if args.measure_from is not None or args.measure_to is not None:
        measured = span_of(video, recorded, lag, args.measure_from, args.measure_to)
    visible = video.visible(recorded)
    hidden = 1 - len(measured.of(visible)) / max(len(measured.of(recorded)), 1)
    recorded = visible
    element = calibrate(until(video, span.end), recorded, span, args.element, progress)
    progress.end()
    simulated = simulate(video, element)
    figures = compare(video, recorded, simulated, measured)
    if args.lag == "find" and not is_found:
        print("The lag cannot be estimated from one frame interval, and is taken as 0; set it with --lag.")
    if lag != 0:
        print(f"Frames show the scene {lag * 1000:.1f} ms later than their timestamps.")
    if hidden >= 0.005:
        print(f"{100 * hidden:.0f} % of the recorded events are excluded: the frames are overexposed there.")
    print(describe(element, figures), flush=True)
    # After the result, which is then not lost if a disk is full.
    if args.profile:
        write_profile(args.profile, element, args.video, args.recording)
    if args.map:
        compare(video, recorded, simulated, measured, args.map)


if __name__ == "__main__":
    try:
        main()
    except (RuntimeError, OSError, GLib.Error) as failure:
        sys.exit(f"error: {failure}")
    except KeyboardInterrupt:
        sys.exit(130)
