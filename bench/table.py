#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints a table of a benchmark's JSON: a row a method, a column a scene and number of threads;
milliseconds a frame and, where the plain formulation was timed too, how many times faster."""
import json
import sys

with open(sys.argv[1], encoding="utf-8") as file:
    runs = json.load(file)["benchmarks"]

times = {}
for run in runs:
    scene, method, formulation, threads = run["name"].split("/")[:4]
    times[scene, method, formulation, threads.split(":")[1]] = run["real_time"]

columns = list(dict.fromkeys((scene, threads) for scene, _, _, threads in times))
methods = list(dict.fromkeys(method for _, method, _, _ in times))


def cell(scene, method, threads):
    ours = times.get((scene, method, "ours", threads)) or times.get(
        (scene, method, "frame", threads)
    )
    if ours is None:
        return ""
    plain = times.get((scene, method, "plain", threads))
    return f"{ours:.2f} ms" + (f", {plain / ours:.1f}x" if plain else "")


print("| method | " + " | ".join(f"{s}, {t} thread(s)" for s, t in columns) + " |")
print("|---" * (len(columns) + 1) + "|")
for method in methods:
    print(f"| {method} | " + " | ".join(cell(s, method, t) for s, t in columns) + " |")
