#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the contrast thresholds at which a simulator generates as many ON and OFF events from a
video as a real camera recorded of the same scene, and prints how similar the two streams are.
For eventsim-dvs it then tries changes one at a time: exposure compensation, refractory period, threshold jitter,
the offset of the logarithm, overexposed light, adaptation, denoising, long exposures and exposure pulses, and keeps
those that make the streams clearly more similar, also in parts that they were not chosen on. Balances the errors of
mean and standard deviation over the pixels. Prints the settings. Overexposed parts of the frames are excluded.

    event-calibrate drive.mp4 drive.raw --profile camera.profile --to 2
    event-calibrate davis.aedat4

VIDEO is anything that GStreamer decodes, or a text file of lines "seconds picture"; RECORDING is
any event file that this project reads. Both need the same pixels and the same clock; a file that has both, such as
AEDAT 4, is given once. --from and --to are in seconds after the first frame; the default is the time that both cover.
--measure-from and --measure-to select another time for the comparison."""
import argparse
import functools
import os
import time
from statistics import harmonic_mean

# Imported first: it reports missing packages.
from event_streams import (Gst, Span, compare, delayed, expect_writable, png_of, read_camera,
                           read_video, seconds, simulate, until)
import numpy as np
from program import VERSION, Progress, find_plugins, option_parser, run
from threshold_search import PRECISION, ROUGH_PRECISION, Setting, find_thresholds

# Windows of the calibrated time, with equally many events each, so that fast parts count. Changes are chosen on every
# second one, and confirmed on the others.
WINDOWS = 8
# Changes of eventsim-dvs that suit some cameras, tried one after the other.
CHANGES = [
    {"linear-light": "true", "log-eps": 0.001},
    {"exposure-compensation": "false"},
    {"refractory-period": 300_000, "refractory-reset": "signal"},
    {"refractory-period": 1_000_000, "refractory-reset": "signal"},
    {"threshold-jitter": 0.1},
    {"threshold-jitter": 0.2},
    {"log-eps": 0.02},
    {"log-eps": 0.1},
    {"overexposed-light": 1},
    {"overexposed-light": 3},
    {"adaptation": 0},
    {"adaptation": 0.1},
    {"adaptation": 0.2},
    {"denoise": 0},
]
# Share of a long exposure in the frame interval.
LONG_EXPOSURE = 0.85
PULSES = [0.04, 0.08, 0.12, 0.16]
# Values of these are shares of the mean threshold.
SHARES = {"threshold-jitter", "exposure-pulse"}
# A change has to gain more likeness than this, and may not cost more map correlation or matches. Smaller gains in one
# part of a recording are often lost in another.
MIN_GAIN = 0.01
# Maximum factor between the numbers of events, when mean and standard deviation are balanced.
MAX_BALANCE = 1.1
# The element that has profiles.
PROFILED = "eventsim-dvs"
# Frames explain the events in blocks of this size, and next to them, where even this threshold is reached.
BLOCK, LOW_THRESHOLD = 8, 0.1
# Largest share of silent pixels among the pixels with this many active neighbours, which have this many events in all.
MAX_SILENT, BUSY_NEIGHBOURS, BUSY_EVENTS = 0.05, 5, 24


def ratings_of(figures):
    """Similarity of two streams, from 0 to 1: their likeness, map correlation, and the mean of the harmonic means of
    the shares of recorded and of simulated events that have a match within 1, 5 and 10 ms. A harmonic mean is close to
    the smaller share, so a simulator cannot trade one share for the other. The likeness is a mean of these, the ratio of
    the variances over the pixels, and the ratio between the times from event to event; matches count six times."""
    sides = figures["reference-matches"], figures["candidate-matches"]
    matches = np.mean([harmonic_mean([side[f"within-{limit}ms"] for side in sides]) for limit in (1, 5, 10)])
    deviations = sorted(figures[side]["std-dev"] for side in ("reference", "candidate"))
    variances = (deviations[0] / deviations[1]) ** 2 if deviations[1] > 0 else 0
    likeness = np.average([figures["map-correlation"], matches, variances, 10 ** -figures["interval-distance"]],
                          weights=[1, 6, 1, 1])
    return np.array([likeness, figures["map-correlation"], matches])


def explained(video, recorded):
    """Whether the frames explain each recorded event: some light changes near it, in its frame interval. Splashes,
    flickering lamps and the noise of the camera are not in the frames."""
    times = [frame.time // 1000 for frame in video.frames]

    def place(events):
        return np.searchsorted(times, events["t"]), events["y"] // BLOCK + 1, events["x"] // BLOCK + 1

    changes = np.zeros((len(times) + 1, video.height // BLOCK + 3, video.width // BLOCK + 3), bool)
    changes[place(simulate(video, f"{PROFILED} positive-threshold={LOW_THRESHOLD}"
                                  f" negative-threshold={LOW_THRESHOLD}"))] = True
    near = np.zeros_like(changes)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near |= np.roll(changes, (down, right), axis=(1, 2))
    return near[place(recorded)]


def silent_pixels(sensor, recorded):
    """Which pixels never fire although their eight neighbours do, and the share of pixels with such neighbours that
    they are."""
    count = np.bincount(sensor.pixels_of(recorded), minlength=sensor.width * sensor.height)
    padded = np.pad(count.reshape(sensor.height, sensor.width), 1)

    def around(values):
        return np.lib.stride_tricks.sliding_window_view(values, (3, 3)).sum(axis=(2, 3)) - values[1:-1, 1:-1]

    busy = (around(padded) >= BUSY_EVENTS) & (around((padded > 0).astype(int)) >= BUSY_NEIGHBOURS)
    silent = busy & (padded[1:-1, 1:-1] == 0)
    return silent, silent.sum() / max(busy.sum(), 1)


class Search:
    """Fits thresholds to the explained events, and rates settings by the likeness of each window."""

    def __init__(self, video, recorded, span, progress):
        self.video, self.recorded, self.span, self.progress = video, recorded, span, progress
        is_explained = explained(video, recorded)
        self.explained = recorded[is_explained]
        in_span = is_explained[(recorded["t"] > span.start) & (recorded["t"] <= span.end)]
        self.unexplained_share = 1 - in_span.mean() if len(in_span) else 0
        self.windows = windows_of(recorded, span)
        # The last stream of a threshold search is rated.
        self.simulated_by = functools.lru_cache(maxsize=4)(functools.partial(simulate, video))
        self.thresholds = None  # of the last setting, the first guess for the next one

    def fit(self, setting, precision=PRECISION, share=1.0):
        """The element with thresholds that fit this share of the events."""
        self.thresholds = find_thresholds(self.simulated_by, self.explained, self.span, setting, self.progress,
                                          self.thresholds, precision, share)
        return setting.with_thresholds(self.thresholds)

    def figures(self, element, window):
        return compare(self.video, self.recorded, self.simulated_by(element), window)

    def ratings(self, element, windows):
        """The ratings of each window."""
        return np.array([ratings_of(self.figures(element, window)) for window in windows])

    def balanced(self, setting):
        """The element with thresholds that balance the errors of the mean event rate and of its standard deviation
        over the pixels: one is too small by the factor that the other is too large."""
        figures = compare(self.video, self.explained, self.simulated_by(self.fit(setting)), self.span)
        mean, deviation = (figures["candidate"][field] / figures["reference"][field] for field in ("mean", "std-dev"))
        return self.fit(setting, share=np.clip(np.sqrt(mean / deviation), 1 / MAX_BALANCE, MAX_BALANCE))


def windows_of(recorded, span):
    """A span cut into windows."""
    times = span.of(recorded)["t"]
    quantiles = np.quantile(times, np.arange(1, WINDOWS) / WINDOWS, method="lower") if len(times) else []
    cuts = [span.start, *sorted({int(time) for time in quantiles} - {span.end}), span.end]
    return [Span(start, end) for start, end in zip(cuts, cuts[1:])]


def is_better(gains):
    """Whether likeness gains by more than noise, and in most windows, and neither map correlation nor matches lose.
    gains: of each rating, by window."""
    mean = gains.mean(axis=0)
    return mean[0] > MIN_GAIN and (mean > -MIN_GAIN).all() and np.mean(gains[:, 0] > 0) > 0.5


def changes_of(video, recorded, span, element):
    """The changes to try: of properties that the element does not set."""
    if element.split()[0] != PROFILED:
        return []
    changes = [{"exposure-time": exposure_of(video)}, *CHANGES]
    if not any(video.overexposed(frame).any() for frame in video.frames):
        changes = [change for change in changes if "overexposed-light" not in change]
    lead = find_exposure_lead(video, recorded, span)
    if lead is not None:
        changes += [{"exposure-lead": lead, "exposure-pulse": pulse} for pulse in PULSES]
    return [change for change in changes if not any(f"{name}=" in element for name in change)]


def changed(element, change):
    shares = {name: value for name, value in change.items() if name in SHARES}
    values = [f"{name}={value}" for name, value in change.items() if name not in SHARES]
    return Setting(" ".join([element, *values]), shares)


def calibrate(search, element):
    """The element with calibrated thresholds, and with the changes that gain on every second window, if they gain on
    the others, too."""
    progress = search.progress
    fitted = search.fit(Setting(element))
    progress.print(describe(f"calibrated thresholds: {fitted}", search.figures(fitted, search.span)))
    windows, held_out = search.windows[::2], search.windows[1::2]
    changes = changes_of(search.video, search.recorded, search.span, element) if held_out else []
    kept = {}
    ratings = search.ratings(fitted, windows)
    began = time.monotonic()
    for tried, change in enumerate(changes, 1):
        other = search.ratings(search.fit(changed(element, kept | change), ROUGH_PRECISION), windows)
        gain = (other - ratings)[:, 0].mean()
        text = " ".join(f"{name}={value}" for name, value in change.items())
        left = (time.monotonic() - began) / tried * (len(changes) - tried)
        progress.prefix = f"{tried} of {len(changes)} changes tried, about {left // 60:.0f}:{left % 60:02.0f} left; "
        progress.update(f"{text}: likeness {gain:+.4f}")
        if is_better(other - ratings):
            kept, ratings = kept | change, other
            progress.print(f"kept {text}: likeness {gain:+.4f}, now {ratings[:, 0].mean():.4f}")
    progress.prefix = ""
    found = search.balanced(changed(element, kept))
    if kept and not is_better(search.ratings(found, held_out) - search.ratings(fitted, held_out)):
        progress.print("dropped all changes: they do not gain on the windows that they were not chosen on")
        return search.balanced(Setting(element))
    return found


def fit_thresholds(video, recorded, span, element, progress):
    """The element with calibrated thresholds, and otherwise unchanged."""
    setting = Setting(element)
    simulated_by = functools.partial(simulate, video)
    return setting.with_thresholds(
        find_thresholds(simulated_by, recorded[explained(video, recorded)], span, setting, progress))


def exposure_of(video):
    """The median exposure of the frames, in nanoseconds, which AEDAT 4 files contain; otherwise most of the median
    interval, a long exposure."""
    exposures = []
    for frame in video.frames:
        meta = frame.buffer.get_custom_meta("GstEventCameraFrame")
        if meta is not None:
            begin, end = (meta.get_structure().get_int64(f"exposure-{name}") for name in ("begin", "end"))
            exposures.append(1000 * (end.value - begin.value))
    if exposures and np.median(exposures) > 0:
        return min(int(np.median(exposures)), Gst.SECOND)
    return min(int(LONG_EXPOSURE * np.median(np.diff([frame.time for frame in video.frames]))), Gst.SECOND)


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
    fitted = fit_thresholds(shown, shown.visible(recorded), over, element, progress)

    @functools.cache
    def likeness_at(lag):
        shown, over = late(lag)
        rating = ratings_of(compare(shown, shown.visible(recorded), simulate(shown, fitted), over))[0]
        progress.update(f"frames {1000 * lag:.1f} ms late: likeness {rating:.4f}")
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
        f"  map correlation  {figures['map-correlation']:>12.3f}",
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
    parser = option_parser(__doc__)
    parser.add_argument("video")
    parser.add_argument("recording", nargs="?", help="default: the events beside the frames of VIDEO, as in AEDAT 4")
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
    parser.add_argument("--make-mask", metavar="PNG",
                        help="write a picture for --mask: black where pixels never fire although their neighbours do")
    parser.add_argument("--profile", metavar="FILE",
                        help="write the settings of eventsim-dvs, for its property profile")
    parser.add_argument("--map", metavar="PNG", help="write a picture of the event counts per pixel")
    args = parser.parse_args()
    args.recording = args.recording or args.video
    return args


def write_profile(path, element, video, recording):
    """Writes the settings of an eventsim-dvs that differ from the defaults."""
    made = Gst.parse_launch(element)
    lines = [f"# Fitted by event-calibrate {VERSION} to {os.path.basename(recording)} and {os.path.basename(video)}",
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
    if latest_start >= earliest_end:
        frames = [video.frames[i].time / 1e9 for i in (0, -1)]
        events = recorded["t"][[0, -1]] / 1e6
        raise RuntimeError(
            f"the clocks differ: the frames are from {frames[0]:.3f} to {frames[1]:.3f} s, the events from"
            f" {events[0]:.3f} to {events[1]:.3f} s. Converted files may start at 0; give a file that has both, such as"
            " AEDAT 4, once and unconverted")
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
                           f" recording have both from {latest_start / 1e6:.3f} to {earliest_end / 1e6:.3f} s; choose"
                           " --from and --to within")
    return span


def main():
    Gst.init(None)
    args = options()
    find_plugins()
    if args.profile and args.element.split()[:1] != [PROFILED]:
        raise RuntimeError(f"only {PROFILED} has profiles, {args.element.split()[0]} has none; leave out --profile")
    for path in filter(None, (args.profile, args.map, args.make_mask)):
        expect_writable(path, filter(None, (args.video, args.recording, args.mask)))
    progress = Progress(interval=60)
    start = getattr(args, "from")
    ends = [end for end in (args.to, args.measure_to) if end is not None]
    progress.print(f"reading {args.video}")
    video = read_video(args.video, start or 0, max(ends) if len(ends) else float("inf"))
    if len(video.frames) < 2:
        raise RuntimeError(f"{args.video}: fewer than two frames")
    progress.print(f"reading {args.recording}")
    recorded = read_camera(args.recording, video, args.mask)
    progress.clear()
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
    silent, silent_share = silent_pixels(video, recorded)
    search = Search(until(video, span.end), recorded, span, progress)
    element = calibrate(search, args.element)
    progress.clear()
    simulated = simulate(video, element)
    figures = compare(video, recorded, simulated, measured)
    if args.lag == "find" and not is_found:
        print("The lag cannot be estimated from one frame interval, and is taken as 0; set it with --lag.")
    if lag != 0:
        print(f"Frames show the scene {lag * 1000:.1f} ms later than their timestamps.")
    if hidden >= 0.005:
        print(f"{100 * hidden:.0f} % of the recorded events are excluded: the frames are overexposed there.")
    if search.unexplained_share >= 0.005:
        print(f"{100 * search.unexplained_share:.0f} % of the recorded events are where the frames do not change, such as noise,"
              " flicker and splashes; the thresholds are fitted to the others.")
    if silent_share > MAX_SILENT and video.mask is None and not args.make_mask:
        print(f"{100 * silent_share:.0f} % of the pixels never fire although their neighbours do, as if the events were"
              " warped to the frames; exclude them: write a mask with --make-mask, and use it with --mask.")
    print(describe(element, figures), flush=True)
    # After the result, which is then not lost if a disk is full.
    if args.profile:
        write_profile(args.profile, element, args.video, args.recording)
    if args.map:
        compare(video, recorded, simulated, measured, args.map)
    if args.make_mask:
        with open(args.make_mask, "wb") as file:
            file.write(png_of(np.where(silent if video.mask is None else silent | ~video.mask, 0, 255)))


if __name__ == "__main__":
    run(main)
