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
from dataclasses import dataclass, field
from statistics import harmonic_mean

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "pipelines"))
from event_calibrate import Search, calibrate, find_lag, fit_thresholds  # noqa: E402
from event_streams import (  # noqa: E402
    Gst, Span, Video, compare, delayed, read_mask, read_recording, read_video, samples_of, simulate, until)
from gst_eventcamera.pipeline import quoted  # noqa: E402
from page import replace_tables  # noqa: E402
from program import Progress  # noqa: E402

# The name of each row, and its element, whose thresholds are fitted.
ROWS = {
    "frame": "eventsim-frame",
    "dense, `dis-lq`, `blend`": "eventsim-dense flow=dis-lq interpolation=blend",
    "dense, `farneback`, `forward`": "eventsim-dense flow=farneback interpolation=forward",
    "sparse": "eventsim-sparse",
    "diff": "eventsim-diff",
    "`preset=esim`": "eventsim-dvs preset=esim",
    "`preset=v2e-noisy`": "eventsim-dvs preset=v2e-noisy",
    "`upsampling=linear`": "eventsim-dvs upsampling=linear",
    "`eventsim-dvs`": "eventsim-dvs",
}
CALIBRATED = "`event-calibrate`"
LAG_IGNORED = f"{CALIBRATED}, lag ignored"
# Rows of the table without calibration.
UNCALIBRATED = ["eventsim-dvs"] + [f"eventsim-dvs preset={preset}" for preset in (
    "davis240c", "davis346", "gen4", "hs-ergb", "ideal", "esim", "icns", "v2e-clean", "v2e-noisy")]
# The methods of the paper, with its thresholds for much motion and for little, and its real events and peers.
PAPER = {
    "eventsim-dense flow=dis-lq": ((3, 56.3079, 58.9868), (13, 0.0472, 1.165)),
    "eventsim-dense flow=dis-hq": ((3, 65.6304, 66.793), (35, 0.0462, 0.8783)),
    "eventsim-dense flow=farneback": ((3, 65.999, 67.4279), (19, 0.0445, 0.574)),
    "eventsim-sparse": ((6, 59.3083, 52.3827), (27, 0.0467, 0.439)),
    "eventsim-diff": ((19, 59.3034, 55.0075), (112, 0.0461, 0.8785)),
}
PAPER_REAL = "| real events | ? | 62.79, 82.71 | | 43 / −17 | 0.046, 1.023 | |"
# Video, its size, and interpolated frames.
PAPER_VIDEOS = (("driving-1280x720-25fps.mp4", 640, 480, 20), ("cars-768x432-12fps.mp4", 768, 432, 10))
# Fields of matches.
WITHIN = ("within-1ms", "within-5ms", "within-10ms")


@dataclass
class ExposedVideo(Video):
    """A video whose recording has events only during exposures."""

    exposures: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # starts and ends, seconds

    def of_camera(self, events):
        before = np.searchsorted(self.exposures[:, 0] * 1e6, events["t"], side="right") - 1
        return events[(before >= 0) & (events["t"] < self.exposures[before, 1] * 1e6)]


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
    exposures: str = ""  # text file of the times of which events are known


SCENES = {
    "slider": Scene("slider-depth, a DAVIS240C on a slider, 240x180", "slider-depth", "images.txt",
                    "events-t-x-y-p.txt.gz", 2, 2),
    "cradle": Scene("dark-cradle, a DAVIS346 in front of Newton's cradle in the dark, 346x260", "dark-cradle",
                    "davis346.aedat4", "davis346.aedat4", 4, 8),
    "balloon": Scene("balloon, a Prophesee Gen4 beside a frame camera at 160 frames per second, 957x856", "balloon",
                     "images.txt", "events.raw", 10, 14, mask="reachable.png"),
    "cups": Scene("blurred-cups, a DAVIS346 with exposures of 104 ms, 346x260", "blurred-cups", "images.txt",
                  "events.raw", 6, 9, exposures="exposures.txt"),
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
    if scene.exposures:
        video = ExposedVideo(**vars(video), exposures=np.loadtxt(os.path.join(folder, scene.exposures)))
    return video, video.of_camera(recorded)


# tables


def calibrated(video, recorded, span, element, progress):
    return calibrate(Search(video, recorded, span, progress), element)


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

    training, _ = spans(video)
    lag = find_lag(until(video, training.end), recorded, training, "eventsim-dvs", progress)

    def measured(video, element, fit):
        """A row of the table, of an element that was fitted to the first intervals."""
        training, test = spans(video)
        visible = video.visible(recorded)
        if fit:
            element = fit(until(video, training.end), visible, training, element, progress)
        progress.update(f"measured: {element}")
        return {"element": element} | compare(video, visible, simulate(video, element), test)

    on_time = delayed(video, lag)
    rows = {name: measured(on_time, element, fit_thresholds) for name, element in ROWS.items()}
    rows[CALIBRATED] = measured(on_time, "eventsim-dvs", calibrated)
    if lag != 0:
        rows[LAG_IGNORED] = measured(video, rows[CALIBRATED]["element"], fit_thresholds)
    uncalibrated = {element: measured(on_time, element, None) for element in UNCALIBRATED}
    progress.clear()
    _, test = spans(on_time)
    hidden = 1 - len(test.of(on_time.visible(recorded))) / len(test.of(recorded))
    return {"title": scene.title, "lag": lag, "calibrated": scene.calibrated,
            "measured": scene.measured, "overexposed": hidden, "rows": rows, "uncalibrated": uncalibrated}


def thresholds_of(element):
    values = re.findall(r"(?:positive|negative)-threshold=([0-9.e+-]+)", element)[-2:]
    return " / ".join(f"{float(value):.3g}" for value in values)


def bold_where(best, text):
    return f"**{text}**" if best else text


def deviation(row, name):
    """The deviation of a figure from the camera's, as a factor minus 1."""
    return row["candidate"][name] / row["reference"][name] - 1


def both_shares(row, within):
    return harmonic_mean([row[f"{side}-matches"][within] for side in ("reference", "candidate")])


def table(result):
    """A row per simulator; the values closest to the real camera are bold."""
    rows = result["rows"]

    def best(value_of, among=rows.values()):
        return max(value_of(row) for row in among)

    def nearness(name):
        return lambda row: -abs(np.log(max(1 + deviation(row, name), 1e-9)))

    real = next(iter(rows.values()))["reference"]
    lines = [
        "| | C+ / C− | mean | std. dev. | map correlation | interval distance"
        " | matches within 1, 5, 10 ms | of real / simulated events |",
        "|---|---|---|---|---|---|---|---|",
        f"| real events | | {real['mean']:.3f} | {real['std-dev']:.3f} | | | | |",
    ]
    for name, row in rows.items():
        cells = [name, thresholds_of(row["element"])]
        for figure in ("mean", "std-dev"):
            cells.append(bold_where(nearness(figure)(row) == best(nearness(figure)),
                                    f"{100 * deviation(row, figure):+.0f} %"))
        cells.append(bold_where(row["map-correlation"] == best(lambda row: row["map-correlation"]),
                                f"{row['map-correlation']:.3f}"))
        cells.append(bold_where(row["interval-distance"] == -best(lambda row: -row["interval-distance"]),
                                f"{row['interval-distance']:.2f}"))
        cells.append(", ".join(
            bold_where(both_shares(row, within) == best(lambda row, within=within: both_shares(row, within)),
                       f"{both_shares(row, within):.2f}") for within in WITHIN))
        cells.append(" / ".join(", ".join(f"{row[f'{side}-matches'][within]:.2f}" for within in WITHIN)
                                for side in ("reference", "candidate")))
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", f"Frame intervals: {result['calibrated']} for calibration, the next {result['measured']} for"
              " measurement.", f"Frame lag: {1000 * result['lag']:.1f} ms.",
              f"Events where the frames are overexposed: {100 * result['overexposed']:.0f} %.", "",
              "```", rows[CALIBRATED]["element"], "```", ""]
    return "\n".join([f"### {result['title'][0].upper()}{result['title'][1:]}", ""] + lines)


def uncalibrated_table(results):
    """The error of the mean of elements that are not calibrated, and their map correlation."""
    lines = ["### Without calibration", "",
             "Error of the mean event rate, and map correlation.", "",
             "| | " + " | ".join(result["title"].split(",")[0] for result in results.values()) + " |",
             "|---|" + "---|" * len(results)]
    for element in UNCALIBRATED:
        cells = []
        for result in results.values():
            row = result["uncalibrated"][element]
            cells.append(f"{100 * deviation(row, 'mean'):+.0f} %, {row['map-correlation']:.2f}")
        lines.append(f"| `{element}` | " + " | ".join(cells) + " |")
    return "\n".join(lines + [""])


def paper_table(data):
    """Mean and standard deviation of the event rate with the paper's thresholds, its own and those here."""
    lines = ["### The paper's thresholds", "",
             "Mean and standard deviation of the event rate per pixel, in Hz.", "",
             "| | driving: C+, C− | paper's video | here | table tennis: C+, C− | paper's video | car park, here |",
             "|---|---|---|---|---|---|---|", PAPER_REAL]
    for element, scenes in PAPER.items():
        cells = [f"`{element}`"]
        for (threshold, mean, deviation), (name, width, height, frames) in zip(scenes, PAPER_VIDEOS):
            with tempfile.TemporaryDirectory() as folder:
                path = os.path.join(folder, "figures.json")
                for _ in samples_of(
                        f"filesrc location={quoted(os.path.join(data, 'video', name))} ! decodebin ! videoscale"
                        f" ! video/x-raw,width={width},height={height} ! {element} positive-threshold={threshold}"
                        f" negative-threshold={threshold} interpolated-frames={frames}"
                        f" ! eventstats location={quoted(path)} ! appsink name=out sync=false"):
                    pass
                with open(path, encoding="utf-8") as file:
                    figures = json.load(file)
            cells += [str(threshold), f"{mean:.4g}, {deviation:.4g}",
                      f"{figures['mean']:.4g}, {figures['std-dev']:.4g}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines + [""])


def plot(path, results):
    """Bar charts of how close each simulator is to the camera."""
    figure, axes = plt.subplots(1, len(results), figsize=(15, 4.2), sharey=True, dpi=90)
    for axis, result in zip(axes, results.values()):
        rows = result["rows"]
        names = [name.replace("`", "") for name in rows if name != LAG_IGNORED][::-1]
        places = np.arange(len(names))
        for offset, (label, colour, value_of) in zip((0.3, 0, -0.3), (
                ("map correlation", "#4080d0", lambda row: row["map-correlation"]),
                ("matches within 5 ms", "#40a070", lambda row: both_shares(row, "within-5ms")),
                ("matches within 1 ms", "#e0a030", lambda row: both_shares(row, "within-1ms")))):
            values = [value_of(row) for name, row in rows.items() if name != LAG_IGNORED][::-1]
            axis.barh(places + offset, values, 0.28, color=colour, label=label)
        axis.set_yticks(places, names)
        axis.set_xlim(0, 1)
        axis.set_title(result["title"].split(",")[0], fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, -0.28), ncols=3)
    figure.tight_layout()
    figure.savefig(path)


def draw(path, scene, data, result):
    """Draws the events of the last interval, side by side: ON blue, OFF dark, both dark blue."""
    colours = np.array([[255, 255, 255], [28, 34, 48], [64, 128, 208], [46, 81, 128]], np.uint8)
    video, recorded = read(scene, data)
    video = delayed(video, result["lag"])
    span = Span(video.frames[-2].time // 1000, video.frames[-1].time // 1000)
    streams = {"real events": span.of(recorded)} | {
        name: span.of(simulate(video, row["element"]))
        for name, row in result["rows"].items() if name != LAG_IGNORED}
    tiles = {"camera, before": video.luma(video.frames[-2])} | {
        name.replace("`", ""): events for name, events in streams.items()}
    columns = 4
    rows = (len(tiles) + columns - 1) // columns
    figure, axes = plt.subplots(rows, columns, figsize=(columns * 4, rows * 3.2), dpi=60)
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
    progress = Progress(60)
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
    text = "\n".join([uncalibrated_table(results)] + [table(result) for result in results.values()]
                     + [paper_table(data)])
    print(text)
    if len(sys.argv) > 1 and len(results) == len(SCENES):
        replace_tables(os.path.join(sys.argv[1], "realism.md"), "bench/realism", text)
        plot(os.path.join(sys.argv[1], "realism-figures.png"), results)
        # The licence of the other recordings allows measuring only.
        draw(os.path.join(sys.argv[1], "realism.png"), SCENES["cradle"], data, results["cradle"])


if __name__ == "__main__":
    main()
