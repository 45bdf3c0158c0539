#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the table of the codec or filter benchmarks, a row for each: million events per second on one core,
and the time relative to a memcpy of the events.

  speed_table.py codecs|filters PAGE.md RUN.json

Also writes the table between the markers of the page."""
import json
import sys

from page import replace_tables, run_on

# Benchmark names without read or write, and the names in the table.
FORMATS = {
    "edges/evt2": "EVT2",
    "edges/evt21": "EVT2.1",
    "edges/evt3": "EVT3",
    "edges/evt4": "EVT4",
    "noise/evt2": "EVT2, noise",
    "noise/evt21": "EVT2.1, noise",
    "noise/evt3": "EVT3, noise",
    "noise/evt4": "EVT4, noise",
    "edges/mcap": "MCAP, EVT3",
    "edges/mcap-lz4": "MCAP, EVT3, LZ4",
    "edges/mcap-zstd": "MCAP, EVT3, Zstandard",
    "noise/dat": "DAT",
    "noise/es": "Event Stream",
    "aedat2": "AEDAT 2",
    "aedat3": "AEDAT 3.1",
    "aedat4/none": "AEDAT 4, uncompressed",
    "aedat4/lz4": "AEDAT 4, LZ4",
    "aedat4/zstd": "AEDAT 4, Zstandard",
    "npy": "NumPy",
    "csv-names": "CSV, whole microseconds",
    "csv-rpg": "TXT, fractional seconds",
    "dsec": "DSEC HDF5, uncompressed",
    "dsec-gzip": "DSEC HDF5, gzip",
    "metavision": "Metavision HDF5",
    "ecf": "ECF without HDF5",
}
# Names of the benchmarks: in the table, and bytes per pixel.
FILTERS = {
    "validation": ("validation of all events, before any filter", "0"),
    "crop": ("`eventcrop`, to a quarter", "0"),
    "rotation": ("`eventflip video-direction=90r`", "0"),
    "polarity": ("`eventpolarity keep=on`", "0"),
    "mask": ("`eventmask`", "1/8"),
    "scale": ("`eventscale`, to a quarter", "8 of the output"),
    "scale-counted": ("`eventscale min-events=4`, to a quarter", "8 of the output"),
    "undistortion": ("`eventundistort`", "4"),
    "refractory": ("`eventrefractory`", "4"),
    "hot-pixel": ("`eventhotpixel`", "4"),
    "trail": ("`eventtrail`", "4"),
    "stc-cut-trail": ("`eventtrail mode=stc-cut-trail`", "4"),
    "anti-flicker": ("`eventantiflicker`", "8"),
    "rate-control": ("`eventratecontrol`", "0"),
    "baf": ("`eventdenoise method=baf`", "4"),
    "stcf": ("`eventdenoise method=stcf`", "4"),
    "time-kernel": ("`eventdenoise method=time-kernel`", "8"),
    "dwf": ("`eventdenoise method=dwf`", "0"),
}
STREAMS = {"real": "recording", "random": "random pixels"}


def cell(run):
    rate = f"{run['Mevents/s']:.3g}" if run["Mevents/s"] < 100 else f"{run['Mevents/s']:.0f}"
    return f"{rate} ({run['memcpys']:.1f})"


def main():
    what, page, path = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        run = json.load(file)
    results = {each["name"]: cell(each) for each in run["benchmarks"] if not each.get("error_occurred")}
    if what == "codecs":
        lines = [run_on(run["context"]), "| format | read | write |", "|---|---|---|"]
        labels, columns = FORMATS, ("read", "write")
    else:
        columns = {key: name for key, name in STREAMS.items() if f"validation/{key}" in results}
        lines = ["| | bytes per pixel | " + " | ".join(columns.values()) + " |", "|---|---|" + "---|" * len(columns)]
        labels = {name: f"{label} | {size}" for name, (label, size) in FILTERS.items()}
    for name, label in labels.items():
        cells = [results.get(f"{name}/{column}", "") for column in columns]
        if any(cells):
            lines.append(f"| {label} | " + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n" + ("" if what == "codecs" else "\n" + run_on(run["context"]))
    print(text)
    replace_tables(page, "bench/run" if what == "codecs" else "bench/run filters", text)


main()
