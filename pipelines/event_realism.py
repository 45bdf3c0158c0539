#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Compares simulated events with those that a real camera recorded of the same scene, beside the noise
ceiling: how similar a second recording by the same camera would be.

    event-realism drive.raw ours.raw v2e.h5 esim.csv --html page.html

All files are event files that this project reads, of the same pixels and with the same clock. --from and
--to are in seconds after the first real event; the default is the time that all cover. Differences
beyond the noise ceiling are marked with *."""
import base64
import functools
import html
import io
import itertools
import os
from dataclasses import dataclass

# Imported first: it reports missing packages.
from event_streams import (Gst, Sensor, Span, compare, expect_writable, png_of, read_camera,
                           read_video, reconstruct, seconds)
import numpy as np
from program import find_plugins, option_parser, page, pyplot_for, run

LIMITS = (1, 5, 10)  # of matches, ms
# Tolerance for figures beyond the ceiling, which is an estimate.
TOLERANCE = 0.05
SPLITS = 20
COLOURS = ["#000000", "#4080d0", "#d07020", "#309060", "#a050c0", "#c04060", "#60a0a0"]


@dataclass
class Stream:
    name: str
    events: np.ndarray
    figures: dict = None  # of eventcompare, against the real stream


@dataclass
class Row:
    """A figure of every stream, as text, and whether it is beyond the ceiling."""

    title: str
    ceiling: str
    cells: list
    beyond: list


def counts_per_pixel(sensor, events):
    counts = np.bincount(sensor.pixels_of(events), minlength=sensor.width * sensor.height)
    return counts.reshape(sensor.height, sensor.width)


def spread_by_chance(sensor, events):
    """Difference to expect between the means, and the standard deviations, of two recordings, as a share: twice
    the root mean square of the differences between random halves of the events, divided by the root of two,
    since a recording has twice as many events as a half."""
    random = np.random.default_rng(1)
    differences = []
    for _ in range(SPLITS):
        half = random.random(len(events)) < 0.5
        a, b = (counts_per_pixel(sensor, part) for part in (events[half], events[~half]))
        differences.append([2 * (a.mean() - b.mean()) / (a.mean() + b.mean()),
                            2 * (a.std() - b.std()) / (a.std() + b.std())])
    return np.sqrt(2 * np.mean(np.square(differences), axis=0))


def similarity(a, b):
    """Mean structural similarity (SSIM; Wang et al., IEEE TIP 2004) of pictures, in windows of 8 x 8 pixels."""
    def mean(values):
        sums = np.pad(values.cumsum(axis=1).cumsum(axis=2), ((0, 0), (1, 0), (1, 0)))
        return (sums[:, 8:, 8:] - sums[:, 8:, :-8] - sums[:, :-8, 8:] + sums[:, :-8, :-8]) / 64

    mean_a, mean_b = mean(a), mean(b)
    variances = mean(a * a) - mean_a ** 2 + mean(b * b) - mean_b ** 2
    covariance = mean(a * b) - mean_a * mean_b
    return np.mean((2 * mean_a * mean_b + 1e-4) * (2 * covariance + 9e-4)
                   / ((mean_a ** 2 + mean_b ** 2 + 1e-4) * (variances + 9e-4)))


def table_of(sensor, real, simulated, span):
    """The rows of the table."""
    first = simulated[0].figures
    ceiling = first["noise-ceiling"]
    rows = []
    chances = spread_by_chance(sensor, real.events)
    for (field, title), chance in zip((("mean", "events per pixel and second"), ("std-dev", "standard deviation")),
                                      chances):
        goal = first["reference"][field]
        off = [stream.figures["candidate"][field] / goal - 1 for stream in simulated]
        rows.append(Row(title, f"{goal:.4g} ±{100 * chance:.1f} %",
                        [f"{stream.figures['candidate'][field]:.4g} ({100 * each:+.0f} %)"
                         for stream, each in zip(simulated, off)],
                        [abs(each) > chance for each in off]))

    def add(title, goal, values, digits=3, is_beyond=lambda value: False):
        rows.append(Row(title, goal if goal == "—" else f"{goal:.{digits}f}", [f"{value:.{digits}f}" for value in values],
                        [is_beyond(value) for value in values]))

    def of_all(*keys):
        return [functools.reduce(dict.get, keys, stream.figures) for stream in simulated]

    for field, title in (("on-share", "share of ON events"), ("active-share", "share of active pixels"),
                         ("distinct-share", "distinct times per event")):
        add(title, first["reference"][field], of_all("candidate", field))
    add("map correlation", "—", of_all("map-correlation"))
    if min(sensor.width, sensor.height) >= 8:
        pictures = reconstruct(sensor, real.events, span)
        add("similarity of reconstructions", "—",
            [similarity(pictures, reconstruct(sensor, stream.events, span)) for stream in simulated])
    goal = ceiling["rate-correlation"]
    add("rate correlation, 1 ms", goal, of_all("rate-correlation"), is_beyond=lambda value: value < goal - TOLERANCE)
    goal = ceiling["interval-distance"]
    add("interval distance, decades", goal, of_all("interval-distance"),
        is_beyond=lambda value: value > goal + TOLERANCE)
    for side, title in (("reference", "real"), ("candidate", "simulated")):
        for limit in LIMITS:
            field = f"within-{limit}ms"
            goal = ceiling["matches"][field]
            add(f"{title} events matched within {limit} ms", goal, of_all(f"{side}-matches", field),
                is_beyond=lambda value: value < goal - TOLERANCE)
        goal = ceiling["matches"]["nearest-distance"] / 1e6
        add(f"nearest match of {title} events, ms", goal,
            [value / 1e6 for value in of_all(f"{side}-matches", "nearest-distance")], digits=2,
            is_beyond=lambda value: value > goal * (1 + 2 * TOLERANCE))
    return rows


def print_table(real, simulated, rows):
    lines = [["", f"{real.name}, ceiling"] + [stream.name for stream in simulated]]
    lines += [[row.title, row.ceiling] + [cell + (" *" if beyond else "  ")
                                          for cell, beyond in zip(row.cells, row.beyond)] for row in rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    for title, *cells in lines:
        print("  ".join([title.ljust(widths[0])] + [cell.rjust(width) for cell, width in zip(cells, widths[1:])])
              .rstrip())
    print("* beyond the noise ceiling: two recordings of the scene by the same camera would differ less")


# the page


def map_of(counts, max_count):
    """A map of events per pixel as a PNG in a data URI; the square root of the count is the brightness."""
    encoded = png_of(255 * np.sqrt(np.minimum(counts / max_count, 1)))
    return "data:image/png;base64," + base64.b64encode(encoded).decode()


def chart(title, x_title, y_title, names, curves, logarithmic=(False, False)):
    """An SVG of curves, given as x and y of each stream, the real one first, which is drawn over the others."""
    figure, axes = pyplot_for("--html").subplots(figsize=(7, 3.6), layout="constrained")
    for i, (name, curve) in reversed(list(enumerate(zip(names, curves)))):
        axes.plot(*np.array(curve, float).reshape(2, -1), color=COLOURS[i % len(COLOURS)], label=name.replace("$", r"\$"))
    axes.set(title=title, xlabel=x_title, ylabel=y_title)
    if logarithmic[0]:
        axes.set_xscale("log")
    else:
        axes.set_xlim(0)
    if logarithmic[1]:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0)
    axes.grid(alpha=0.3)
    axes.legend(*(each[::-1] for each in axes.get_legend_handles_labels()), framealpha=0)
    file = io.StringIO()
    figure.savefig(file, format="svg", transparent=True)
    svg = file.getvalue().replace("#000000", "currentColor")  # light on a dark page
    return f"<figure>{svg[svg.index('<svg'):]}</figure>"


def intervals_of(sensor, events):
    """Times between successive events of a pixel, rounded up to half a microsecond."""
    pixels = sensor.pixels_of(events)
    order = np.argsort(pixels, kind="stable")
    same = np.diff(pixels[order]) == 0
    return np.maximum(np.diff(events["t"][order])[same], 0.5)


def interval_curve(sensor, events):
    """Share of the intervals in each tenth of a decade, in ms."""
    share, edges = np.histogram(np.log10(intervals_of(sensor, events)), np.arange(-0.35, 7.05, 0.1))
    return 10 ** ((edges[:-1] + edges[1:]) / 2 - 3), share / max(share.sum(), 1)


def travels_of(path, sensor, span):
    """Total rise and total fall of each pixel's logarithm, in the frames of a time span of a video."""
    video = read_video(path, 0, float("inf"))
    if (video.width, video.height) != (sensor.width, sensor.height):
        raise RuntimeError(f"{path} has {video.width} x {video.height} pixels, the recording has"
                           f" {sensor.width} x {sensor.height}")
    greys = [np.log(video.luma(frame) + 1) for frame in video.frames
             if span.start <= frame.time // 1000 <= span.end]
    if len(greys) < 2:
        raise RuntimeError(f"{path} has fewer than two frames in the compared time")
    changes = np.diff(greys, axis=0)
    return np.maximum(changes, 0).sum(axis=0), np.maximum(-changes, 0).sum(axis=0)


def response_curve(sensor, events, travels):
    """Mean number of events of a pixel and polarity, by the total change of its signal."""
    is_on = events["p"]
    counts = np.concatenate([counts_per_pixel(sensor, events[part]).ravel() for part in (is_on, ~is_on)])
    travel = np.concatenate([each.ravel() for each in travels])
    edges = 2.0 ** np.arange(-8, 6)
    bins = np.digitize(travel, edges)
    return [(travel[bins == i].mean(), counts[bins == i].mean())
            for i in range(1, len(edges)) if (bins == i).sum() >= 20]


def charts_of(sensor, real, simulated, travels):
    """The curves of the page, with the response to light if the changes of the light are known."""
    streams = [real] + simulated
    names = [stream.name for stream in streams]
    rates = []
    for i, stream in enumerate(streams):
        curve = (stream.figures or simulated[0].figures)["rate-curve"]
        counts = np.array(curve["candidate" if i > 0 else "reference"], float)
        rates.append((np.arange(len(counts)) * curve["bin"] / 1e6, counts / curve["bin"] * 1e3))
    charts = [chart("Event rate", "ms", "Mev/s", names, rates),
              chart("Times between successive events of a pixel", "ms", "share", names,
                    [interval_curve(sensor, stream.events) for stream in streams], (True, False))]
    if travels is not None:
        charts.append(chart("Response", "change of the logarithm of the light", "events per pixel and polarity", names,
                            [np.transpose(response_curve(sensor, stream.events, travels)) for stream in streams],
                            (True, True)))
    else:
        own = counts_per_pixel(sensor, real.events).ravel()
        curves = [((0.5, max(own.max(), 1)), (0.5, max(own.max(), 1)))]
        for stream in simulated:
            theirs = counts_per_pixel(sensor, stream.events).ravel()
            groups = [(theirs[chosen].mean(), own[chosen].mean()) for low in range(12)
                      if (chosen := (theirs >= 2 ** low) & (theirs < 2 ** (low + 1))).sum() >= 20]
            curves.append(np.transpose(groups) if groups else ((), ()))
        charts.append(chart("Real events of the pixels with as many simulated ones", "simulated events of a pixel",
                            "real events", names, curves, (True, True)))
    return charts


STYLE = """
.beyond { color: light-dark(#b02020, #ff8080) } .maps, .charts { display: grid; gap: 1rem }
.maps { grid-template-columns: repeat(auto-fill, minmax(18rem, 1fr)) }
.charts { grid-template-columns: repeat(auto-fill, minmax(min(32rem, 100%), 1fr)) }
img { width: 100%; image-rendering: pixelated } svg { width: 100%; height: auto } svg text { fill: currentColor }
.bar { display: flex; justify-content: space-between; max-width: 18rem; padding: .1rem .4rem; background: linear-gradient(90deg, #000, #fff) }
.bar span:nth-child(-n+2) { color: #fff } .bar span { color: #000 }
"""


def page_of(sensor, real, simulated, rows, charts):
    streams = [real] + simulated
    maps = [counts_per_pixel(sensor, stream.events) for stream in streams]
    max_count = max(np.quantile(maps[0][maps[0] > 0], 0.995), 1)
    names = [html.escape(stream.name) for stream in streams]
    header = [f'<th style="border-bottom: 3px solid {colour}">{name}</th>'
              for name, colour in zip([f"{names[0]}, ceiling"] + names[1:], itertools.cycle(["currentColor"] + COLOURS[1:]))]
    body = [(row.title, [f"<td>{row.ceiling}</td>"] + [
        f'<td class="beyond">{cell} *</td>' if beyond else f"<td>{cell}</td>"
        for cell, beyond in zip(row.cells, row.beyond)]) for row in rows]
    figures = "".join(f'<figure><figcaption>{name}</figcaption><img alt="events per pixel" src="{map_of(each, max_count)}">'
                      "</figure>" for name, each in zip(names, maps))
    return page(f"Realism of {', '.join(names[1:])}", f"Beside {names[0]}", STYLE, header, body,
            "<p>* beyond the noise ceiling: two recordings of the scene by the same camera would differ less.</p>"
            f'<h2>Events per pixel</h2><p class="bar"><span>0</span><span>{max_count / 4:.3g}</span><span>{max_count:.3g}'
            "</span></p><p>White: the count that 99.5 % of the pixels with real events do not exceed. The brightness is"
            f' the square root of the count.</p><div class="maps">{figures}</div><div class="charts">{"".join(charts)}</div>')


# the program


def options():
    parser = option_parser(__doc__)
    parser.add_argument("real")
    parser.add_argument("simulated", nargs="+")
    parser.add_argument("--from", type=seconds, metavar="SECONDS", help="start of the comparison")
    parser.add_argument("--to", type=seconds, metavar="SECONDS", help="end of the comparison")
    parser.add_argument("--mask", metavar="PICTURE",
                        help="a picture that is white where pixels of the camera can fire; events elsewhere"
                        " are excluded from all streams")
    parser.add_argument("--video", metavar="VIDEO",
                        help="the frames, for the page's response curve: a video, or a text file of lines"
                        " \"seconds picture\"")
    parser.add_argument("--html", metavar="PAGE", help="write a page with maps and curves")
    return parser.parse_args()


def span_of(streams, start, end):
    """The time from `start` to `end` after the first real event; by default the time that all streams cover."""
    origin = int(streams[0].events["t"][0])
    first = max(int(stream.events["t"][0]) for stream in streams) if start is None else origin + round(start * 1e6)
    last = min(int(stream.events["t"][-1]) for stream in streams) if end is None else origin + round(end * 1e6)
    if start is not None and end is not None and first >= last:
        raise RuntimeError("--from must be less than --to")
    if first >= last:
        raise RuntimeError("the streams do not overlap in time: "
                           + ", ".join(f"{stream.name} lasts from {stream.events['t'][0] / 1e6:.6f} to"
                                       f" {stream.events['t'][-1] / 1e6:.6f} s" for stream in streams)
                           + ". A .raw file whose first event is later than 12 hours is written from 0 on; .npz and"
                             " .aedat4 keep all times.")
    return Span(first - 1, last)


def main():
    Gst.init(None)
    args = options()
    find_plugins()
    if args.video and not args.html:
        raise RuntimeError("--video needs a page; name one with --html")
    if args.html:
        pyplot_for("--html")
        expect_writable(args.html, filter(None, [args.real, *args.simulated, args.mask, args.video]))
    sensor = Sensor()
    streams = []
    for path in [args.real] + args.simulated:
        streams.append(Stream(os.path.basename(path), read_camera(path, sensor, args.mask)))
    span = span_of(streams, getattr(args, "from"), args.to)
    for stream in streams:
        stream.events = span.of(stream.events)
    real, *simulated = streams
    if len(real.events) == 0:
        raise RuntimeError(f"{args.real}: no events in the compared time; choose another with --from and --to")
    travels = travels_of(args.video, sensor, span) if args.html and args.video else None
    for stream in simulated:
        stream.figures = compare(sensor, real.events, stream.events, span)
    rows = table_of(sensor, real, simulated, span)
    print_table(real, simulated, rows)
    if args.html:
        with open(args.html, "w", encoding="utf-8") as file:
            file.write(page_of(sensor, real, simulated, rows, charts_of(sensor, real, simulated, travels)))


if __name__ == "__main__":
    run(main)
