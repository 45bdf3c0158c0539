#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the table of the filter benchmarks, a row per filter: million events per second on one core,
and the time relative to a memcpy of the events.

  filter_table.py PAGE.md RUN.json

Also writes the table between the markers of the page."""
import json
import sys

from page import replace_tables, run_on

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


def main():
    page, path = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        run = json.load(file)
    results = {each["name"]: each for each in run["benchmarks"]}
    streams = {key: name for key, name in STREAMS.items() if f"validation/{key}" in results}
    lines = ["| | bytes per pixel | " + " | ".join(streams.values()) + " |", "|---|---|" + "---|" * len(streams)]
    for name, (label, size) in FILTERS.items():
        cells = [results[f"{name}/{stream}"] for stream in streams]
        lines.append(f"| {label} | {size} | "
                     + " | ".join(f"{each['Mevents/s']:.0f} ({each['memcpys']:.1f})" for each in cells) + " |")
    text = "\n".join(lines) + "\n\n" + run_on(run["context"])
    print(text)
    replace_tables(page, "bench/run filters", text)


if __name__ == "__main__":
    main()
