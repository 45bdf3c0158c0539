#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the table of the codec benchmarks, a row per format: million events per second on one core,
and the time relative to a memcpy of the decoded events.

  codec_table.py PAGE.md RUN.json...

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


def results_of(run):
    """(million events per second, memcpys) by (format, read or write)."""
    results = {}
    for each in run["benchmarks"]:
        if not each.get("error_occurred"):
            results[tuple(each["name"].rsplit("/", 1))] = each["Mevents/s"], each["memcpys"]
    return results


def cell(result):
    if result is None:
        return ""
    rate = f"{result[0]:.3g}" if result[0] < 100 else f"{result[0]:.0f}"
    return f"{rate} ({result[1]:.1f})"


def main():
    page, *runs = sys.argv[1:]
    results = {}
    for path in runs:
        with open(path, encoding="utf-8") as file:
            run = json.load(file)
        results |= results_of(run)
    lines = [
        run_on(run["context"]),
        "| format | read | write |",
        "|---|---|---|",
    ]
    for name, label in FORMATS.items():
        cells = [cell(results.get((name, what))) for what in ("read", "write")]
        if any(cells):
            lines.append(f"| {label} | {cells[0]} | {cells[1]} |")
    text = "\n".join(lines) + "\n"
    print(text)
    replace_tables(page, "bench/run", text)


main()
