#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Calibrates every simulator on the first frame intervals of a recording that has frames and real
events of the same pixels, and compares it with the real events of the other intervals. Prints the
tables.

  realism.py [DOCS]

Given a folder, writes the tables between the markers of its realism.md, and draws them:
realism-figures.png has bars, realism.png the events themselves."""
import gzip
import json
import os
import re
import shutil
import sys
import tempfile
from dataclasses import dataclass

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "pipelines"))
from event_calibrate import Progress, calibrate, find_lag, fit_thresholds  # noqa: E402
from event_streams import (  # noqa: E402
    Gst, Span, compare, delayed, read_mask, read_recording, read_video, simulate, until)
from page import replace_tables  # noqa: E402

# The name of each row, and its element.
ROWS = {
    "frame": "eventsim-frame",
    "dense, `dis-lq`, `forward`": "eventsim-dense flow=dis-lq interpolation=forward",
    "dense, `dis-lq`, `blend`": "eventsim-dense flow=dis-lq interpolation=blend",
    "dense, `dis-hq`, `forward`": "eventsim-dense flow=dis-hq interpolation=forward",
    "dense, `dis-hq`, `blend`": "eventsim-dense flow=dis-hq interpolation=blend",
    "dense, `farneback`, `forward`": "eventsim-dense flow=farneback interpolation=forward",
    "dense, `farneback`, `blend`": "eventsim-dense flow=farneback interpolation=blend",
    "sparse": "eventsim-sparse",
    "diff": "eventsim-diff",
    "`eventsim-dvs`": "eventsim-dvs",
}
# Of these, only the thresholds are fitted.
PRESETS = {f"`{element}`": element for element in ("eventsim-dvs preset=esim", "eventsim-dvs preset=v2e-noisy")} | {
    "`eventsim-dvs`, thresholds only": "eventsim-dvs",
    "`eventsim-dvs`, thresholds only, straight lines": "eventsim-dvs upsampling=linear",
}
CALIBRATED = "`eventsim-dvs`"
# Fields of matches.
WITHIN = ("within-1ms", "within-5ms", "within-10ms")
# What each stage of the calibrated element contributes: the same without it, with thresholds that fit again.
WITHOUT = {
    f"{CALIBRATED}, `{change}`": change
    for change in ("response=linear", "upsampling=linear", "upsampling=motion", "denoise=0", "adaptation=0",
                   "threshold-jitter=0", "exposure-pulse=0")
}


@dataclass
class Scene:
    """Frames and real events of the same pixels."""

    title: str
    folder: str
    video: str
    recording: str
    calibrated: int  # frame intervals to calibrate on
    measured: int  # frame intervals after them to measure
    mask: str = ""  # picture that is white where pixels of the camera can fire


SCENES = {
    "slider": Scene("slider-depth, a DAVIS240C on a slider, 240x180", "slider-depth", "images.txt",
                    "events-t-x-y-p.txt.gz", 2, 2),
    "cradle": Scene("dark-cradle, a DAVIS346 in front of Newton's cradle in the dark, 346x260", "dark-cradle",
                    "davis346.aedat4", "davis346.aedat4", 4, 8),
    "balloon": Scene("balloon, an event camera beside a frame camera at 160 frames per second, 957x856", "balloon",
                     "images.txt", "events.raw", 10, 14, "reachable.png"),
    "davis": Scene("a DAVIS346 in front of a workbench, 346x260", "events",
                   "davis346-frames-events-imu.aedat4", "davis346-frames-events-imu.aedat4", 1, 1),
}


def unpacked(path, folder):
    if not path.endswith(".gz"):
        return path
    plain = os.path.join(folder, os.path.basename(path)[:-len(".gz")])
    with gzip.open(path) as packed, open(plain, "wb") as file:
        shutil.copyfileobj(packed, file)
    return plain


def read(scene, data):
    folder = os.path.join(data, scene.folder)
    # Selected by number below: their times are not known yet.
    video = read_video(os.path.join(folder, scene.video), 0, 10)
    video.frames = video.frames[:scene.calibrated + scene.measured + 1]
    with tempfile.TemporaryDirectory() as scratch:
        recorded = read_recording(unpacked(os.path.join(folder, scene.recording), scratch), video)
    if scene.mask:
        video.mask = read_mask(os.path.join(folder, scene.mask), video)
    return video, video.of_camera(recorded)


def measure(scene, data, progress):
    """The rows of a scene. With several intervals to calibrate on, the first only gives the pixels a
    history."""
    video, recorded = read(scene, data)
    past = min(scene.calibrated - 1, 1)

    def spans(delayed_video):
        times = [frame.time // 1000 for frame in delayed_video.frames]
        last = scene.calibrated + scene.measured
        return (Span(times[past], times[scene.calibrated]),
                Span(times[scene.calibrated], times[last]))

    lag = 0.0
    if past > 0:
        training, _ = spans(video)
        lag = find_lag(until(video, training.end), recorded, training, ROWS[CALIBRATED], progress)

    def measured(video, element, fit):
        """A row of the table, of an element that was fitted to the first intervals."""
        training, test = spans(video)
        visible = video.visible(recorded)
        element = fit(until(video, training.end), visible, training, element, progress)
        progress.tell(f"measured: {element}")
        return {"element": element} | compare(video, visible, simulate(video, element), test)

    on_time = delayed(video, lag)
    rows = {name: measured(on_time, element, calibrate) for name, element in ROWS.items()}
    rows |= {name: measured(on_time, element, fit_thresholds) for name, element in PRESETS.items()}
    calibrated = rows[CALIBRATED]["element"]
    for name, change in WITHOUT.items():
        if change not in calibrated.split() and f" {change.split('=')[0]}=" in calibrated:
            rows[name] = measured(on_time, f"{calibrated} {change}", fit_thresholds)
    if lag != 0:
        rows[f"{CALIBRATED}, lag ignored"] = measured(video, calibrated, fit_thresholds)
    progress.end()
    _, test = spans(on_time)
    hidden = 1 - len(test.of(on_time.visible(recorded))) / len(test.of(recorded))
    return {"title": scene.title, "lag": lag, "calibrated": scene.calibrated,
            "measured": scene.measured, "overexposed": hidden, "rows": rows}


def thresholds_of(element):
    values = re.findall(r"(?:positive|negative)-threshold=([0-9.e+-]+)", element)[-2:]
    return " / ".join(f"{float(value):.3g}" for value in values)


def bold_where(best, text):
    return f"**{text}**" if best else text


def table(result):
    """A row per simulator; the values closest to the real camera are bold."""
    rows = result["rows"]
    first = next(iter(rows.values()))
    real, ceiling = first["reference"], first["noise-ceiling"]
    matches = ", ".join(f"{ceiling['matches'][within]:.2f}" for within in WITHIN)
    shares = [(side, within) for side in ("reference", "candidate") for within in WITHIN]

    def off(row, field):
        return abs(np.log(max(row["candidate"][field], 1e-9) / real[field]))

    nearest = {field: min(off(row, field) for row in rows.values())
               for field in ("mean", "std-dev")}
    best_map = max(row["map-correlation"] for row in rows.values())
    best_intervals = min(row["interval-distance"] for row in rows.values()
                         if row["interval-distance"] > 0)
    best_share = {share: max(row[f"{share[0]}-matches"][share[1]] for row in rows.values())
                  for share in shares}
    lines = [
        "| | C+ / C− | mean | std. dev. | map correlation | interval distance"
        " | real events matched within 1, 5, 10 ms | simulated events matched |",
        "|---|---|---|---|---|---|---|---|",
        f"| real events | | {real['mean']:.3f} | {real['std-dev']:.3f} | | | | |",
        f"| noise ceiling | | | | {ceiling['map-correlation']:.3f} | {ceiling['interval-distance']:.2f}"
        f" | {matches} | {matches} |",
    ]
    for name, row in rows.items():
        cells = [name, thresholds_of(row["element"])]
        for field in ("mean", "std-dev"):
            value = row["candidate"][field]
            cells.append(bold_where(
                off(row, field) == nearest[field],
                f"{value:.3f} ({100 * (value / real[field] - 1):+.0f} %)"))
        cells.append(bold_where(row["map-correlation"] == best_map,
                                f"{row['map-correlation']:.3f}"))
        cells.append(bold_where(row["interval-distance"] == best_intervals,
                                f"{row['interval-distance']:.2f}"))
        for side in ("reference", "candidate"):
            values = []
            for within in WITHIN:
                value = row[f"{side}-matches"][within]
                values.append(bold_where(value == best_share[side, within], f"{value:.2f}"))
            cells.append(", ".join(values))
        lines.append("| " + " | ".join(cells) + " |")
    calibrated = rows[CALIBRATED]["element"]
    lag = f"{1000 * result['lag']:.1f} ms" if result["lag"] != 0 else "not estimated"
    lines += ["", f"Frame intervals: {result['calibrated']} for calibration, the next {result['measured']} for measurement.",
              f"Frame lag: {lag}.", f"Events where the frames are overexposed: {100 * result['overexposed']:.0f} %.",
              "Calibrated element:", "", "```", calibrated, "```", ""]
    return "\n".join([f"### {result['title'][0].upper()}{result['title'][1:]}", ""] + lines)


def plot(path, rows):
    """Bar charts of how close each simulator is to the camera."""
    real = next(iter(rows.values()))["reference"]
    names = [name.replace("`", "") for name in rows][::-1]
    panels = {
        "standard deviation, relative to the camera": (
            [row["candidate"]["std-dev"] / real["std-dev"] for row in rows.values()], 1),
        "map correlation": ([row["map-correlation"] for row in rows.values()], None),
        "real events matched within 5 ms": (
            [row["reference-matches"]["within-5ms"] for row in rows.values()], None),
        "simulated events matched": (
            [row["candidate-matches"]["within-5ms"] for row in rows.values()], None),
    }
    figure, axes = plt.subplots(1, len(panels), figsize=(15, 4.6), sharey=True, dpi=90)
    for axis, (title, (values, goal)) in zip(axes, panels.items()):
        axis.barh(names, values[::-1], color="#4080d0")
        axis.set_title(title, fontsize=10)
        if goal is not None:
            axis.axvline(goal, color="#1c2230", linewidth=1)
        axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)


def draw(path, scene, data, elements):
    """Draws the events of the last interval, side by side: ON blue, OFF dark, both dark blue."""
    colours = np.array([[255, 255, 255], [28, 34, 48], [64, 128, 208], [46, 81, 128]], np.uint8)
    video, recorded = read(scene, data)
    span = Span(video.frames[-2].time // 1000, video.frames[-1].time // 1000)
    streams = {"real events": span.of(recorded)} | {
        name: span.of(simulate(video, element)) for name, element in elements.items()}
    tiles = {"camera, before": video.luma(video.frames[-2])} | {
        name.replace("`", ""): events for name, events in streams.items()}
    columns = 5
    rows = (len(tiles) + columns - 1) // columns
    figure, axes = plt.subplots(rows, columns, figsize=(columns * 3.5, rows * 2.9), dpi=60)
    for axis in axes.flat:
        axis.axis("off")
    for axis, (name, tile) in zip(axes.flat, tiles.items()):
        axis.set_title(name, fontsize=10)
        if tile.dtype.names is None:
            axis.imshow(tile, cmap="gray", vmin=0, vmax=255)
            continue
        kinds = np.zeros((video.height, video.width), np.uint8)
        on = tile["p"]
        kinds[tile["y"][~on], tile["x"][~on]] |= 1
        kinds[tile["y"][on], tile["x"][on]] |= 2
        axis.imshow(colours[kinds])
    figure.tight_layout()
    figure.savefig(path)


def main():
    data = os.environ.get("SHARED_DATA", os.path.join("..", "shared", "data"))
    Gst.init(None)
    progress = Progress()
    results = {}
    for key, scene in SCENES.items():
        if not os.path.exists(os.path.join(data, scene.folder, scene.recording)):
            print(f"{scene.title}: skipped, no {os.path.join(data, scene.folder)}",
                  file=sys.stderr)
            continue
        results[key] = measure(scene, data, progress)
    if not results:
        print("No recordings, nothing to measure.", file=sys.stderr)
        return
    if os.path.isdir("bench-output"):
        with open(os.path.join("bench-output", "realism.json"), "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
    text = "\n".join(table(result) for result in results.values())
    print(text)
    if len(sys.argv) > 1 and len(results) == len(SCENES):
        replace_tables(os.path.join(sys.argv[1], "realism.md"), "bench/realism", text)
        plot(os.path.join(sys.argv[1], "realism-figures.png"), results["slider"]["rows"])
        # The licence of the other recording allows measuring only.
        draw(os.path.join(sys.argv[1], "realism.png"), SCENES["davis"], data,
             {name: row["element"] for name, row in results["davis"]["rows"].items()})


if __name__ == "__main__":
    main()
