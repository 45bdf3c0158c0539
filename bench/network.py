#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Shows runs of rtp_bench and datagrams_bench:

  network.py PAGE.md PLOT.png RUN.json...

Writes the tables of loopback speed and of bytes per event between the markers of the page, and
draws how speed and load grow with the event rate and the size of packets."""
import json
import sys

from page import replace_tables, run_on
from plots import INK, plt
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

COLOURS = {
    "RTP EVT3": "#2f6fb5",
    "RTP XYTP": "#7fb2e5",
    "spif": "#3a9a68",
    "spif-timestamps": "#8bc99f",
    "t64-x16-y16-on8": "#d0573e",
    "t32-x16-y15-on1": "#e0a458",
    "es": "#6a6f7a",
    "jaer": "#8a5ab5",
}


# Recordings of real cameras, and random pixels.
SCENES = {"640x480": "640x480 camera", "1280x720": "1280x720 camera", "noise": "random pixels"}


def runs_of(paths):
    """Benchmarks by the parts of their names, and the context of the last run."""
    runs, context = {}, None
    for path in paths:
        with open(path, encoding="utf-8") as file:
            run = json.load(file)
        context = run["context"]
        for benchmark in run["benchmarks"]:
            runs[tuple(benchmark["name"].split("/iterations")[0].split("/"))] = benchmark
    return runs, context


def table_of(runs, context):
    lines = [run_on(context), "| format | sent, Mev/s | lost | processors in use |", "|---|---|---|---|"]
    for name in COLOURS:
        if run := runs.get(("loopback", name.removeprefix("RTP "))):
            lines.append(f"| {name} | {run['Mevents/s']:.1f} | {run['lost%']:.1f} % | {run['processors']:.1f} |")
    if run := runs.get(("latency",)):
        lines.append(f"\nLatency of RTP at 1 Mev/s: median {run['p50-ms']:.1f} ms, 99th percentile {run['p99-ms']:.1f} ms.")
    lines += ["", f"| bytes per event | {' | '.join(SCENES.values())} |", "|---" * (len(SCENES) + 1) + "|"]
    for name in COLOURS:
        packed = [runs.get((scene, name.removeprefix("RTP "), "pack")) for scene in SCENES]
        lines.append(" | ".join([f"| {name}", *(f"{run['bytes/event']:.1f}" if run else "–" for run in packed)]) + " |")
    return "\n".join(lines) + "\n"


def points_of(runs, axis, name, value):
    return sorted((float(key[3]), value(run)) for key, run in runs.items() if key[:3] == ("growth", axis, name))


def received(run):
    return run["Mevents/s"] * (1 - run["lost%"] / 100)


def processors(run):
    return run["processors"]


def draw(runs, path):
    panels = [
        ("rate", received, "sent, million events/s", "received, million events/s", "Through loopback"),
        ("rate", processors, "sent, million events/s", "processors in use, sender and receiver", "Load"),
        ("mtu", processors, "mtu, bytes", "processors in use", "Load at 20 million events/s"),
    ]
    figure, all_axes = plt.subplots(1, 3, figsize=(14, 5))
    for axes, (axis, value, label, of, title) in zip(all_axes, panels):
        ticks = set()
        for name, colour in COLOURS.items():
            if points := points_of(runs, axis, name, value):
                axes.plot(*zip(*points), color=colour, linewidth=1.9, marker="o", markersize=4)
                ticks.update(x for x, _ in points)
        axes.set_xscale("log")
        axes.set_xticks(sorted(ticks))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_ylim(bottom=0)
        axes.grid(color="#e8eaee", linewidth=0.8)
        axes.set_xlabel(label)
        axes.set_ylabel(of)
        axes.set_title(title, pad=8)
    rates = [0, max(x for x, _ in points_of(runs, "rate", "RTP EVT3", received))]
    all_axes[0].plot(rates, rates, color=INK, linewidth=0.9, linestyle=":", zorder=0)
    lines = [plt.Line2D([], [], color=colour, linewidth=2) for colour in COLOURS.values()]
    figure.legend(lines, list(COLOURS), loc="lower center", ncol=len(COLOURS), frameon=False)
    figure.tight_layout(rect=(0, 0.06, 1, 1), w_pad=2.5)
    figure.savefig(path, dpi=110)


def main():
    page, plot, *paths = sys.argv[1:]
    runs, context = runs_of(paths)
    text = table_of(runs, context)
    print(text)
    draw(runs, plot)
    replace_tables(page, "bench/run network", text)


main()
