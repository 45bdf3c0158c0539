#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Describes recordings of event cameras.

    event-info recording.raw
    event-info recording.raw --plot rate.png
    event-info --json *.raw"""
import json
import sys

# Imported first: it requires the versions.
from event_files import (Failure, Gst, Interrupt, PlayProgress, content_of, events_pad, parse, play, reader_of, run,
                         utf8_path)
from program import find_plugins, option_parser, pyplot_for
import numpy as np

BIN = 10_000  # of the event rate, in microseconds
MAX_BINS = 1 << 24
# Minimum events of a hot pixel, in all, per second, and relative to all of its neighbours but one.
HOT_EVENTS, HOT_RATE, HOT_RATIO = 10, 10, 5
SHOWN_PIXELS = 8
XYTP = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])
DAMAGE = {"corrupt-places": "corrupt places", "outside-events": "events outside the sensor",
          "late-items": "late items", "stray-items": "items at an impossible time"}


class Counts:
    """Counts the events of a stream by pixel and time."""

    def __init__(self):
        self.first = self.last = None  # times of events, in microseconds
        self.on = 0
        self.bins = np.zeros(0, np.int64)  # events of each bin, from the first event on
        self.pixels = np.zeros((0, 0), np.int64)  # events by row and column

    def add(self, _, buffer, pad):
        """Called for each buffer of events."""
        events = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), XYTP)
        if len(events) == 0:
            return
        sensor = pad.get_current_caps().get_structure(0)
        width, height = sensor.get_value("width"), sensor.get_value("height")
        if self.pixels.shape != (height, width):  # a reader that guesses the size may find a larger one
            grown = np.zeros((height, width), np.int64)
            grown[:self.pixels.shape[0], :self.pixels.shape[1]] = self.pixels
            self.pixels = grown
        place = (events["y_p"] & 0x7fff).astype(np.int64) * width + events["x"]
        self.pixels += np.bincount(place, minlength=width * height).reshape(height, width)
        self.on += int(np.count_nonzero(events["y_p"] & 0x8000))
        times = buffer.pts // 1000 + events["t"].astype(np.int64)
        self.first, self.last = int(times[0]) if self.first is None else self.first, int(times[-1])
        bins = np.minimum((times - self.first) // BIN, MAX_BINS - 1)
        if bins[-1] >= len(self.bins):
            self.bins = np.pad(self.bins, (0, max(int(bins[-1]) + 1, 2 * len(self.bins)) - len(self.bins)))
        self.bins += np.bincount(bins, minlength=len(self.bins))

    def hot_pixels(self, seconds):
        """Columns and rows of hot pixels, the busiest first."""
        padded = np.pad(self.pixels, 1)
        found = []
        for y, x in zip(*np.nonzero(self.pixels >= max(HOT_EVENTS, HOT_RATE * seconds))):
            others = np.sort(np.delete(padded[y:y + 3, x:x + 3].ravel(), 4))
            if self.pixels[y, x] >= HOT_RATIO * others[-2]:
                found.append((int(x), int(y)))
        return sorted(found, key=lambda pixel: -self.pixels[pixel[1], pixel[0]])


def tagged(tags, name):
    """The text of a tag, or None."""
    return next((text for given, text in (each.get_string(name) for each in tags) if given), None)


def read(path, progress, interrupt):
    """Reads a whole recording. Returns its counts, and a description for JSON."""
    _, caps = content_of(path)
    reader = reader_of(path, caps)
    if not reader:
        raise Failure(f"{path} is not a recording of events; gst-discoverer-1.0 describes videos")
    counts, warnings = Counts(), []
    has_streams = reader.has_pads("events_%u")
    pipeline = parse(f"filesrc name=in ! {reader.name} name=reader {'' if has_streams else '!'}"
                     " queue name=queue ! fakesink name=events signal-handoffs=true sync=false")
    pipeline.get_by_name("in").set_property("location", utf8_path(path))
    pipeline.get_by_name("events").connect("handoff", counts.add)
    source = pipeline.get_by_name("reader")
    if has_streams:
        source.connect("no-more-pads", lambda _: (pad := events_pad(source)) and pad.link(
            pipeline.get_by_name("queue").get_static_pad("sink")))

    def show():
        known, at = source.query_position(Gst.Format.TIME)
        is_known, duration = source.query_duration(Gst.Format.TIME)
        progress.show(at / duration if known and is_known and duration > 0 else None, f"{counts.bins.sum()} events")

    try:
        play(pipeline, show, warnings.append, interrupt)
        stats = source.get_property("stats")
        known, duration = source.query_duration(Gst.Format.TIME)
        pads = [pad for pad in source.srcpads if pad.get_current_caps()]
        streams = {pad.get_name(): pad.get_current_caps().to_string() for pad in pads}
        events = [pad.get_sticky_event(Gst.EventType.TAG, i) for pad in pads for i in range(8)]
        tags = [event.parse_tag() for event in filter(None, events)]
    finally:
        progress.clear()
        pipeline.set_state(Gst.State.NULL)
    events = int(counts.pixels.sum())
    length = duration / 1e9 if known else ((counts.last or 0) - (counts.first or 0)) / 1e6
    number = {name: stats.get_uint64(name)[1] for name in ("triggers", "frames", "imu-samples", *DAMAGE)}
    height, width = counts.pixels.shape
    content = caps.get_structure(0).get_name().removeprefix("application/x-") if caps else reader.extension
    hot = counts.hot_pixels(length)
    return counts, {
        "path": path,
        "format": tagged(tags, Gst.TAG_CONTAINER_FORMAT) or content,
        "camera": tagged(tags, Gst.TAG_DEVICE_MODEL), "width": width, "height": height, "streams": streams,
        "start": (counts.first or 0) / 1e6, "duration": length, "events": events,
        "on-share": counts.on / events if events else None, "mean-rate": events / length if length else None,
        "max-rate": int(counts.bins.max(initial=0)) * 1e6 / BIN,
        "active-share": float(np.count_nonzero(counts.pixels) / counts.pixels.size) if events else None,
        "hot-pixels": hot, **{name: number[name] for name in ("triggers", "frames", "imu-samples")},
        "damage": {name: number[name] for name in DAMAGE if number[name]}, "warnings": warnings}


def described(info):
    """The description, as text."""
    if info["events"] == 0:
        rows = {"format": info["format"], "events": "0"}
    else:
        hot = info["hot-pixels"]
        rows = {
            "format": info["format"], "camera": info["camera"] or "not stated",
            "sensor": f"{info['width']} x {info['height']}, {100 * info['active-share']:.1f} % of the pixels have events",
            "time": f"{info['duration']:.6f} s, from {info['start']:.6f} s on",
            "events": f"{info['events']:,}, {100 * info['on-share']:.1f} % ON",
            "rate": f"{info['mean-rate'] / 1e6:.3g} Mev/s, at most {info['max-rate'] / 1e6:.3g} Mev/s"
            f" in {BIN // 1000} ms",
            "hot pixels": f"{len(hot)}" + (": " if hot else "") + " ".join(f"({x}, {y})" for x, y in hot[:SHOWN_PIXELS])
            + (" ..." if len(hot) > SHOWN_PIXELS else "")}
    rows["also"] = ", ".join(f"{info[name]:,} {text}" for name, text in (
        ("triggers", "triggers"), ("frames", "frames"), ("imu-samples", "IMU samples")) if info[name]) or "nothing else"
    rows["streams"] = "\n".join(f"{name}: {caps}" for name, caps in info["streams"].items())
    rows["damage"] = "\n".join([f"{count:,} {DAMAGE[name]}" for name, count in info["damage"].items()]
                               + info["warnings"]) or "none"
    return "\n".join([info["path"], *("  {:12}{}".format(name, text.replace("\n", "\n" + " " * 14))
                                      for name, text in rows.items())])


def plot(counts, info, path):
    """Draws the event rate over time."""
    used = counts.bins[:((counts.last or 0) - (counts.first or 0)) // BIN + 1]
    step = -(-max(len(used), 1) // 1000)  # bins of a point
    rates = np.add.reduceat(used, range(0, len(used), step)) / (step * BIN) if len(used) else used
    figure, axes = pyplot_for("--plot").subplots(figsize=(8, 3), layout="constrained")
    axes.fill_between(np.arange(len(rates)) * step * BIN / 1e6, rates, step="post", color="#4080d0")
    axes.set(xlabel="time (s)", ylabel="event rate (Mev/s)", title=info["path"], ylim=(0, None))
    axes.margins(x=0)
    figure.savefig(path, dpi=150)


def main():
    Gst.init(None)
    parser = option_parser(__doc__, prog="event-info")
    parser.add_argument("files", nargs="+", metavar="FILE")
    parser.add_argument("--json", action="store_true", help="print JSON: a list with an object for each file")
    parser.add_argument("--plot", metavar="PICTURE", help="draw the event rate over time, for one FILE")
    options = parser.parse_args()
    if options.plot and len(options.files) != 1:
        parser.error("--plot needs one FILE")
    find_plugins(["eventcam"])
    interrupt, described_files, status = Interrupt(), [], 0
    for path in options.files:
        try:
            counts, info = read(path, PlayProgress(), interrupt)
        except Failure as failure:
            print(failure if path in str(failure) else f"{path}: {failure}", file=sys.stderr)
            status = 1
            continue
        described_files.append(info)
        if not options.json:
            print(described(info))
        if options.plot:
            plot(counts, info, options.plot)
        if interrupt:
            print(f"interrupted: {path} was read in part", file=sys.stderr)
            return 1
    if options.json:
        print(json.dumps(described_files, indent=1))
    return status


if __name__ == "__main__":
    run(main)
