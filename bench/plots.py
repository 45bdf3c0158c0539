#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Draws the plots of a run of the benchmarks:

  plots.py BENCHMARKS.json DIRECTORY

DIRECTORY/runtimes.png: the runtimes of the paper, beside ours here and on a GPU; the latter are read from
DIRECTORY/benchmarks.md.
DIRECTORY/growth.png: how the methods' cost grows."""
import json
import os
import re
import statistics
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

INK = "#262b36"
PAPER = "#b9bec9"
OURS = "#2f6fb5"
OURS_ON_GPU = "#3a9a68"
EVENTCV = "#dfe2e8"
# Rows of the growth plots: label and colour of each method.
GROWTH = [
    {
        "frame": ("frame", "#6a6f7a"),
        "sparse": ("sparse", "#3a9a68"),
        "diff": ("diff", "#d0573e"),
    },
    {
        "dense-dis-lq": ("dense, dis-lq", "#7fb2e5"),
        "dense-dis-hq": ("dense, dis-hq", "#2f6fb5"),
        "dense-farneback": ("dense, farneback", "#8a5ab5"),
    },
    {
        "dvs": ("dvs, default", "#262b36"),
        "dvs-ideal": ("dvs, ideal", "#3a9a68"),
        "dvs-denoised": ("dvs, ideal, denoise=8", "#2f6fb5"),
        "dvs-v2e-noisy": ("dvs, v2e-noisy", "#d0573e"),
        "dvs-motion": ("dvs, ideal, upsampling=motion", "#c99a2e"),
    },
]

# The coordinates of the paper's two runtime figures, in milliseconds (Ziegler et al., ICRA 2023):
# on a car's camera at 640x480, and on a table-tennis ball at 1280x720.
PAPER_RUNTIMES = [
    # label, our name of the method or None, car, ball
    ("difference frame", "frame", 0.43, 0.45),
    ("dense, DIS lq", "dense-dis-lq", 17.69, 43.51),
    ("dense, DIS hq", "dense-dis-hq", 58.30, 72.37),
    ("dense, Farneback", "dense-farneback", 72.81, 186.06),
    ("sparse, LK", "sparse", 144.99, 4.88),
    ("difference, LK", "diff", 67.64, 3.02),
    ("dense, Farneback (GPU)", "gl-dense-farneback", 20.22, 49.30),
    ("sparse, LK (GPU)", "gl-sparse", 22.45, 4.66),
    ("difference, LK (GPU)", "gl-diff", 10.07, 2.87),
    ("v2e (GPU)\nand eventsim-dvs, v2e-noisy", "dvs-v2e-noisy", 71741.58, 49934.16),
    ("vid2e (GPU)\nand eventsim-dvs, upsampling=motion", "dvs-motion", 1420506.78, 43040.42),
]
# The documentation of EventCV's simulator: a moving edge at 640x480 and at 1280x720, on 12 cores.
EVENTCV_RUNTIMES = ("EventCV", None, 56, 185)
ROWS = [
    *PAPER_RUNTIMES,
    EVENTCV_RUNTIMES,
    ("eventsim-dvs, default", "dvs", None, None),
    ("eventsim-dvs, ideal", "dvs-ideal", None, None),
]
REAL_TIME = 30  # milliseconds, the paper's line
ON_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}

plt.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "font.size": 10,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": "#9aa0ac",
        "xtick.color": INK,
        "ytick.color": INK,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 11,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
    }
)


def short(value):
    """Rounds to three digits."""
    if value >= 1e6:
        return f"{value / 1e6:.3g} M"
    if value >= 1e4:
        return f"{value / 1e3:.0f} k"
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def runs_of(benchmarks):
    """Benchmarks by name; the median time of those that ran repeatedly."""
    runs = {}
    for benchmark in benchmarks:
        if benchmark["run_type"] == "iteration":
            name = re.sub("/(min_time:[^/]*|real_time)", "", benchmark["name"])
            runs.setdefault(name, []).append(benchmark)
    return {
        name: {**same[0], "real_time": statistics.median(run["real_time"] for run in same)}
        for name, same in runs.items()
    }


def gpu_times(page):
    """Milliseconds per frame from memory to events, by scene and method, from the table of ./bench/run gl in a page."""
    with open(page, encoding="utf-8") as file:
        text = file.read()
    table = text[text.index("| scene | method | events |") :].split("\n\n", 1)[0]
    header, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    times = {}
    scene = ""
    for row in (dict(zip(header, row)) for row in rows):
        if row["scene"]:
            scene = "-".join(row["scene"].split(", ")[:2])
        method = re.sub("[`,]", "", row["method"]).replace(" ", "-")
        times[f"{scene}/gl-{method}"] = float(row["element"])
    return times


def draw_runtimes(runs, on_gpu, path):
    panels = [
        ("Many events: from a moving car, 640x480", "driving-640x480", 2),
        ("Few events: a ball, 1280x720", "ball-1280x720", 3),
    ]

    def bars_of(row, scene, column):
        bars = [(row[column], EVENTCV if row is EVENTCV_RUNTIMES else PAPER)] if row[column] else []
        if run := runs.get(f"{scene}/{row[1]}/ours/threads:2"):
            bars.append((run["real_time"], OURS))
        if f"{scene}/{row[1]}" in on_gpu:
            bars.append((on_gpu[f"{scene}/{row[1]}"], OURS_ON_GPU))
        return bars

    # Both panels have the same rows, as high as the one with more bars.
    rows = [[bars_of(row, scene, column) for _, scene, column in panels] for row in ROWS]
    figure, all_axes = plt.subplots(1, 2, figsize=(13, 10), sharey=True)
    for panel, (axes, (title, _, _)) in enumerate(zip(all_axes, panels)):
        top = 0.0
        ticks = []
        for row in rows:
            height = max(map(len, row))
            ticks.append(top + (height - 1) / 2)
            for i, (value, colour) in enumerate(row[panel]):
                axes.barh(top + i, value, height=0.86, color=colour)
                axes.text(value * 1.12, top + i, short(value), va="center", fontsize=8.5, bbox=ON_WHITE)
            top += height + 0.7
        axes.axvline(REAL_TIME, color="#5a62d8", linewidth=1, linestyle=(0, (4, 3)), zorder=0)
        axes.text(
            REAL_TIME,
            -1.1,
            f"{REAL_TIME} ms",
            color="#5a62d8",
            ha="center",
            va="center",
            fontsize=8.5,
            bbox=ON_WHITE,
        )
        axes.set_xscale("log")
        axes.set_xlim(0.01, 2e7)
        axes.set_ylim(top - 0.3, -1.3)
        axes.set_yticks(ticks)
        axes.set_yticklabels([row[0] for row in ROWS])
        axes.tick_params(axis="y", length=0)
        axes.xaxis.set_major_locator(LogLocator(10, numticks=20))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(axis="x", color="#e8eaee", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.set_xlabel("milliseconds per frame")
        axes.set_title(title, pad=14)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in (PAPER, EVENTCV, OURS, OURS_ON_GPU)]
    figure.legend(
        handles,
        [
            "the paper's figures: its footage, measured on its machine (i7-9700, RTX 2080 Ti)",
            "EventCV's figures: a moving edge, on its machine (12 cores)",
            "ours: our footage, our machine, two threads",
            "ours on an NVIDIA H200: the same footage, with uploading and reading back",
        ],
        loc="lower center",
        ncol=2,
        frameon=False,
        fontsize=9,
        handlelength=1.2,
    )
    figure.tight_layout(rect=(0, 0.055, 1, 1), w_pad=2)
    figure.savefig(path, dpi=110)


def points_of(runs, axis, counter, method):
    prefix = f"growth/{axis}/{method}/"
    return sorted((run[counter], run["real_time"]) for name, run in runs.items() if name.startswith(prefix))


def scale_growth(axes, runs, axis):
    axes.set_yscale("log")
    if axis == "changed":
        axes.set_xscale("symlog", linthresh=0.01, linscale=0.5)
        axes.set_xlim(0, 1.1)
        axes.set_xticks([0, 0.01, 0.1, 0.3, 1])
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{100 * x:g} %"))
    elif axis == "n":
        axes.set_xlim(left=0)
    elif axis == "pixels":
        sizes = {run["pixels"]: name.rsplit("/", 1)[1] for name, run in runs.items() if name.startswith("growth/pixels/")}
        axes.set_xscale("log")
        axes.set_xticks(list(sizes), list(sizes.values()), fontsize=7.5)
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: short(x)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes.grid(color="#e8eaee", linewidth=0.8)


def draw_growth(runs, path):
    columns = [
        ("pixels", "pixels", "frame size (by number of pixels)", "A tenth moves, n = 10"),
        ("n", "n", "n, interpolated frames", "A tenth of 640x480 moves"),
        ("changed", "changed", "share of changed pixels", "640x480, n = 10"),
        ("events", "events", "events a frame, by the thresholds", "A third of 640x480 moves, n = 10"),
    ]
    figure, all_axes = plt.subplots(len(GROWTH), len(columns), figsize=(17, 11), sharey="row")
    for row, (methods, row_axes) in enumerate(zip(GROWTH, all_axes)):
        for axes, (axis, counter, label, title) in zip(row_axes, columns):
            lines = [
                (points, colour)
                for method, (_, colour) in methods.items()
                if (points := points_of(runs, axis, counter, method))
            ]
            if not lines:
                axes.text(0.5, 0.5, "eventsim-dvs does not have n", transform=axes.transAxes, ha="center")
                axes.set_axis_off()
                continue
            for points, colour in lines:
                axes.plot(*zip(*points), "-", color=colour, linewidth=1.9, marker="o", markersize=4)
            scale_growth(axes, runs, axis)
            axes.tick_params(labelleft=True)
            axes.set_xlabel(label)
            if row == 0:
                axes.set_title(title, pad=8)
        row_axes[0].set_ylabel("milliseconds per frame")
        lines = [plt.Line2D([], [], color=colour, linewidth=2) for _, colour in methods.values()]
        row_axes[0].legend(lines, [label for label, _ in methods.values()], frameon=False, fontsize=9)
    figure.tight_layout(h_pad=2, w_pad=1.5)
    figure.savefig(path, dpi=100)


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        runs = runs_of(json.load(file)["benchmarks"])
    draw_runtimes(runs, gpu_times(os.path.join(sys.argv[2], "benchmarks.md")), os.path.join(sys.argv[2], "runtimes.png"))
    draw_growth(runs, os.path.join(sys.argv[2], "growth.png"))


if __name__ == "__main__":
    main()
