# SPDX-License-Identifier: LGPL-2.1-or-later
"""The reports of a data set: manifest, lists of its parts, statistics, and a page of pictures."""
import html
import json
import os
import urllib.parse

import numpy as np

# Fields of a record that go to the manifest: all that do not depend on the machine's file system.
PUBLISHED = ("name", "split", "input", "making", "parameters", "written", "figures", "warnings", "versions")
STYLE = """body { font: 14px sans-serif; margin: 2em; background: #fff; color: #222 }
.videos { display: flex; flex-wrap: wrap; gap: 1em }
figure { margin: 0; width: 160px }
img { display: block; width: 160px; border: 1px solid #ccc; image-rendering: pixelated }
figcaption { overflow-wrap: anywhere; font-size: 12px } small { color: #666 }
td, th { text-align: right; padding: 0 1em 0 0 } th:first-child, td:first-child { text-align: left }"""


def write_json(path, content):
    write_text(path, json.dumps(content, indent=1, sort_keys=True) + "\n")


def write_text(path, text):
    with open(path + ".new", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".new", path)


def write_reports(output, recipe, records):
    """Writes them from the records, by name, which are None for videos that are not made."""
    made = [record for record in records.values() if record and "written" in record]
    refused = {record["name"]: record["refused"] for record in records.values() if record and "refused" in record}
    with open(recipe.path, encoding="utf-8") as file:
        text = file.read()
    write_json(os.path.join(output, "manifest.json"), {
        "recipe": text, "seed": recipe.seed, "refused": refused,
        "videos": [{key: record[key] for key in PUBLISHED} for record in made]})
    for part in recipe.split:
        paths = [record["written"]["path"] + "\n" for record in made if record["split"] == part]
        write_text(os.path.join(output, f"{part}.txt"), "".join(paths))
    statistics = statistics_of(made)
    write_json(os.path.join(output, "statistics.json"), statistics)
    write_text(os.path.join(output, "preview.html"), page_of(recipe, made, statistics))


def statistics_of(made):
    """Sums over the videos of each part and of all, and percentiles of their event rates."""
    parts = {"all": made}
    for record in made:
        if record["split"]:
            parts.setdefault(record["split"], []).append(record)
    statistics = {}
    for part, records in parts.items():
        figures = [record["figures"] for record in records]
        events, on = (sum(one[key] for one in figures) for key in ("events", "on-events"))
        rates = [one["mean-rate"] for one in figures]
        statistics[part] = {
            "videos": len(records), "frames": sum(one["frames"] for one in figures),
            "duration": round(sum(one["duration"] for one in figures), 6), "events": events,
            "on-share": round(on / events, 4) if events > 0 else None,
            "bytes": sum(record["written"]["size"] for record in records),
            **{f"rate-p{p}": round(float(np.percentile(rates, p))) if rates else None for p in (5, 50, 95)}}
    return statistics


def page_of(recipe, made, statistics):
    """An offline page; its pictures lie beside it."""
    header = "".join(f"<th>{key}</th>" for key in statistics["all"])
    rows = "".join(f"<tr><td>{html.escape(part)}</td>" + "".join(f"<td>{value}</td>" for value in figures.values())
                   + "</tr>" for part, figures in statistics.items())
    return (f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{html.escape(os.path.basename(recipe.path))}'
            f"</title><style>{STYLE}</style><h1>{html.escape(os.path.basename(recipe.path))}</h1>"
            f"<table><tr><th></th>{header}</tr>{rows}</table>"
            "<p>For each video, the busiest of a few frame intervals; ON blue, OFF red.</p>"
            f'<div class="videos">{"".join(map(figure_of, made))}</div>\n')


def figure_of(record):
    figures = record["figures"]
    parameters = " ".join(f"{name}={value}" for name, value in record["parameters"].items())
    picture = "previews/" + urllib.parse.quote(record["name"]) + ".png"
    return (f'<figure><img loading="lazy" src="{html.escape(picture)}" alt="" title="{html.escape(parameters)}">'
            f"<figcaption>{html.escape(record['name'])}<br><small>{record['split']} {figures['frames']} frames,"
            f" {figures['mean-rate'] / 1e6:.3f} Mev/s</small></figcaption></figure>")
