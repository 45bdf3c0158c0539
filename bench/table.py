#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the tables of a benchmark run: a summary; milliseconds per frame, a row per method and a
column per scene; the same for dense flow alone, with its speed relative to OpenCV's; and the sizes that
each method sustains in real time.

  table.py BENCHMARKS.json [PAGE.md]

Given a page, also writes the tables between its markers."""
import json
import statistics
import sys

from page import replace_tables, run_on

SCENES = {
    "driving-640x480": "driving, 640x480, n = 20",
    "cars-1280x720": "cars, 1280x720, n = 10",
    "busy-cars-1280x720": "busy cars, 1280x720, n = 10",
    "bottles-640x360": "bottles, 640x360, n = 10",
    "ball-1280x720": "ball, 1280x720, n = 10",
}
METHODS = {
    "frame": "frame",
    "dense-after-flow": "dense, after the flow",
    "dense-dis-lq": "dense, `dis-lq`, with flow",
    "dense-dis-hq": "dense, `dis-hq`, with flow",
    "dense-opencv-dis": "dense, `opencv-dis`, with flow",
    "dense-farneback": "dense, `farneback`, with flow",
    "sparse": "sparse, with tracking",
    "diff": "diff, with tracking",
    "dvs": "dvs, default, with flow",
    "dvs-ideal": "dvs, `ideal`",
    "dvs-denoised": "dvs, `ideal`, `denoise=8`",
    "dvs-v2e-noisy": "dvs, `v2e-noisy`",
    "dvs-motion": "dvs, `ideal`, `upsampling=motion`, with flow",
}
SUMMARY = {
    "frame": "`eventsim-frame`",
    "dense-dis-lq": "`eventsim-dense flow=dis-lq`",
    "dense-dis-hq": "`eventsim-dense flow=dis-hq`",
    "dense-farneback": "`eventsim-dense flow=farneback`",
    "sparse": "`eventsim-sparse`",
    "diff": "`eventsim-diff`",
    "dvs": "`eventsim-dvs`",
    "dvs-ideal": "`eventsim-dvs preset=ideal`",
    "dvs-v2e-noisy": "`eventsim-dvs preset=v2e-noisy`",
}
FLOWS = {
    "flow-dis-lq": "`dis-lq`",
    "flow-dis-hq": "`dis-hq`",
    "flow-farneback": "`farneback`",
}
RATES = [30, 60]  # frames per second
COPIES = {
    "events-to-buffer": "events → buffer",
    "buffer-to-grey-picture": "buffer → grey picture",
    "buffer-to-rgbx-picture": "buffer → RGBx picture",
}


def times_of(run):
    """Milliseconds by (scene, method, formulation, threads); the median of repeated runs."""
    times = {}
    for benchmark in run["benchmarks"]:
        parts = benchmark["name"].split("/")
        if benchmark["run_type"] == "iteration" and parts[0] in SCENES:
            scene, method, formulation, threads = parts[:4]
            key = (scene, method, formulation, threads.split(":")[1])
            times.setdefault(key, []).append(benchmark["real_time"])
    return {key: statistics.median(values) for key, values in times.items()}


def sizes_of(run):
    """Milliseconds of each method at growing frame sizes."""
    sizes = {}
    for benchmark in run["benchmarks"]:
        parts = benchmark["name"].split("/")
        if benchmark["run_type"] == "iteration" and parts[0] == "sizes" and not benchmark.get("error_occurred"):
            sizes.setdefault(parts[1], {})[parts[2]] = benchmark["real_time"]
    return sizes


def milliseconds(time):
    return f"{time:.3g}" if time < 100 else f"{time:.0f}"


def table(times, rows, threads, header, cell):
    scenes = [scene for scene in SCENES if any(key[0] == scene for key in times)]
    lines = []
    for method, label in rows.items():
        cells = [cell(times, scene, method, threads) for scene in scenes]
        if any(cells):
            lines.append(f"| {label} | " + " | ".join(cells) + " |")
    if not lines:
        return ""
    head = [f"| {header} | " + " | ".join(SCENES[scene] for scene in scenes) + " |"]
    return "\n".join(head + ["|---" * (len(scenes) + 1) + "|"] + lines) + "\n"


def of_ours(times, scene, method, threads):
    ours = times.get((scene, method, "ours", threads))
    return "" if ours is None else milliseconds(ours)


def beside(other, text):
    """What a cell says about our time and that of the other implementation."""

    def cell(times, scene, method, threads):
        ours = times.get((scene, method, "ours", threads))
        theirs = times.get((scene, method, other, threads))
        return "" if ours is None or theirs is None else text(ours, theirs)

    return cell


beside_opencv = beside("opencv", lambda ours, opencv: (
    f"**{opencv / ours:.2f}×** {milliseconds(ours)} ms (OpenCV {milliseconds(opencv)})"))
beside_memcpy = beside("memcpy", lambda ours, memcpy: (
    f"**{ours / memcpy:.1f}×** memcpy ({milliseconds(ours)} ms)"))


def largest_size(times, rate):
    """The largest frame size that takes at most the time of a frame at this rate."""
    sustained = [size for size in times if times[size] <= 1000 / rate]
    return f"**{sustained[-1]}**" if sustained else "none"


def table_of_sizes(sizes):
    """The largest size that each method sustains at a rate, and its times."""
    columns = list(dict.fromkeys(size for times in sizes.values() for size in times))
    if not columns:
        return ""
    heads = ["two threads", *(f"{rate} frames/s" for rate in RATES), *(f"{size}, ms" for size in columns)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for method, label in METHODS.items():
        if times := sizes.get(method):
            cells = [label, *(largest_size(times, rate) for rate in RATES)]
            cells += [milliseconds(times[size]) if size in times else "" for size in columns]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def summary(times, sizes):
    """Milliseconds per frame in three scenes, and the largest size that each method sustains."""
    columns = ["driving, 640x480", "busy cars, 1280x720", "driving, 1920x1080", "real time at 30 frames/s"]
    lines = ["| two threads, ms | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for method, label in SUMMARY.items():
        sized = sizes.get(method, {})
        found = [
            times.get(("driving-640x480", method, "ours", "2")),
            times.get(("busy-cars-1280x720", method, "ours", "2")),
            sized.get("1920x1080"),
        ]
        cells = ["" if each is None else milliseconds(each) for each in found]
        cells.append(largest_size(sized, 30) if sized else "")
        if any(cells):
            lines.append("| " + " | ".join([label, *cells]) + " |")
    return "\n".join(lines) + "\n"


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        run = json.load(file)
    times, sizes = times_of(run), sizes_of(run)
    short = "\n".join([summary(times, sizes), run_on(run["context"])])
    tables = [
        table(times, METHODS, "2", "two threads, ms", of_ours),
        table(times, METHODS, "1", "one thread, ms", of_ours),
        table(times, FLOWS, "2", "flow alone, two threads", beside_opencv),
        table(times, FLOWS, "1", "flow alone, one thread", beside_opencv),
        table_of_sizes(sizes),
        table(times, COPIES, "1", "one thread", beside_memcpy),
    ]
    text = "\n".join(each for each in tables if each)
    print(short + "\n" + text)
    if len(sys.argv) > 2:
        replace_tables(sys.argv[2], "bench/run, in short", short)
        replace_tables(sys.argv[2], "bench/run", text)


main()
