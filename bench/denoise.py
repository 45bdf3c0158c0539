#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Draws ROC curves of the methods of eventdenoise, and tabulates the areas under them:

  denoise.py PAGE.md PICTURE.png SCENE=RESULTS.txt...

RESULTS.txt are written by denoise_bench. Also writes the tables between the markers of the page."""
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from page import replace_tables  # noqa: E402

METHODS = {
    "time-kernel": ("`time-kernel`", "#2f6fb5"),
    "stcf": ("`stcf`", "#3a9a68"),
    "stcf-match-polarity": ("`stcf match-polarity=true`", "#8a5ab5"),
    "baf": ("`baf`", "#c99a2e"),
    "dwf": ("`dwf`", "#d0573e"),
}
RATES = [1, 5, 10]
# Areas for a third-party C++ implementation on DND21's driving scene.
PUBLISHED = {"time-kernel": (0.948, 0.941, 0.935), "stcf": (0.922, 0.907, 0.897), "baf": (0.914, 0.865, 0.827)}


def read(path):
    """Points (share of noise kept, share of signal kept, setting) by (rate, method)."""
    curves = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            rate, method, setting, signal, noise = line.split()
            curves.setdefault((float(rate), method), []).append((float(noise), float(signal), float(setting)))
    return {key: sorted(points) for key, points in curves.items()}


def area(points):
    """Area under a curve from (0, 0) to (1, 1)."""
    points = [(0, 0)] + [point[:2] for point in points] + [(1, 1)]
    return sum((b[0] - a[0]) * (a[1] + b[1]) / 2 for a, b in zip(points, points[1:]))


def tables(scenes):
    header = [f"{scene}, {rate} Hz" for scene in scenes for rate in RATES]
    lines = ["| area under the curve | " + " | ".join(header) + " | published, 1, 5, 10 Hz |",
             "|---|" + "---|" * (len(header) + 1)]
    for method, (label, _) in METHODS.items():
        cells = [f"{area(curves[rate, method]):.3f}" for curves in scenes.values() for rate in RATES]
        published = ", ".join(f"{value:.3f}" for value in PUBLISHED.get(method, ()))
        lines.append(f"| {label} | " + " | ".join(cells) + f" | {published} |")
    lines += ["", "| defaults: signal kept, noise kept (%) | " + " | ".join(header) + " |",
              "|---|" + "---|" * len(header)]
    for method, (label, _) in METHODS.items():
        if (RATES[0], f"default-{method}") not in next(iter(scenes.values())):
            continue
        cells = []
        for curves in scenes.values():
            for rate in RATES:
                noise, signal, _ = curves[rate, f"default-{method}"][0]
                cells.append(f"{100 * signal:.0f}, {100 * noise:.0f}")
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def draw(scenes, picture):
    figure, axes = plt.subplots(len(scenes), len(RATES), figsize=(9.6, 3.3 * len(scenes)), sharex=True,
                                sharey=True, squeeze=False)
    for row, (scene, curves) in zip(axes, scenes.items()):
        for plot, rate in zip(row, RATES):
            for method, (label, colour) in METHODS.items():
                points = curves[rate, method]
                plot.plot([0] + [p[0] for p in points] + [1], [0] + [p[1] for p in points] + [1], color=colour,
                          label=label.replace("`", ""))
                for noise, signal, _ in curves.get((rate, f"default-{method}"), []):
                    plot.plot(noise, signal, "o", color=colour, markersize=5)
            plot.set_title(f"{scene}, {rate} Hz of noise", fontsize=10)
            plot.grid(alpha=0.3)
    for plot in axes[-1]:
        plot.set_xlabel("share of noise kept")
    for row in axes:
        row[0].set_ylabel("share of signal kept")
    axes[0][-1].legend(fontsize=8, loc="lower right")
    figure.tight_layout()
    figure.savefig(picture, dpi=100)


def main():
    page, picture, *files = sys.argv[1:]
    scenes = {name: read(path) for name, path in (file.split("=", 1) for file in files)}
    text = tables(scenes)
    print(text)
    replace_tables(page, "bench/denoise", text)
    draw(scenes, picture)


if __name__ == "__main__":
    main()
