# SPDX-License-Identifier: LGPL-2.1-or-later
"""The reports of a data set: manifest, lists of its parts, statistics, and a page of pictures."""
import html
import json
import os
import urllib.parse

import numpy as np
from program import page

# Fields of a record that go to the manifest: all that do not depend on the machine's file system.
PUBLISHED = ("name", "split", "input", "making", "parameters", "written", "figures", "warnings", "versions")
STYLE = """
.videos { display: grid; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); gap: 1rem } td { white-space: nowrap }
img { display: block; width: 100% } figcaption { overflow-wrap: anywhere; font-size: 12px }
"""
# Columns of the page's table, and their text from the statistics of a part.
COLUMNS = {
    "videos": lambda part: f"{part['videos']:,}",
    "frames": lambda part: f"{part['frames']:,}",
    "duration": lambda part: duration_text(part["duration"]),
    "million events": lambda part: f"{part['events'] / 1e6:,.2f}",
    "ON": lambda part: "" if part["on-share"] is None else f"{100 * part['on-share']:.0f} %",
    "MB": lambda part: f"{part['bytes'] / 1e6:,.1f}",
    **{f"event rate, {name} (Mev/s)": lambda part, key=key: "" if part[key] is None else f"{part[key] / 1e6:.3f}"
       for name, key in {"5th percentile": "rate-p5", "median": "rate-p50", "95th percentile": "rate-p95"}.items()},
}


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
        lines = [line_of(record) + "\n" for record in made if record["split"] == part]
        write_text(os.path.join(output, f"{part}.txt"), "".join(lines))
    statistics = statistics_of(made)
    write_json(os.path.join(output, "statistics.json"), statistics)
    write_text(os.path.join(output, "preview.html"), page_of(recipe, made, statistics))


def line_of(record):
    """A line of a part's list: the paths of a video's files, and its class, the folder of the video."""
    paths = [file["path"] for file in record["written"].values()]
    return "\t".join(filter(None, [*paths, os.path.dirname(record["name"])]))


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
            "bytes": sum(file["size"] for record in records for file in record["written"].values()),
            **{f"rate-p{p}": round(float(np.percentile(rates, p))) if rates else None for p in (5, 50, 95)}}
    return statistics


def duration_text(seconds):
    if seconds < 120:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"


def page_of(recipe, made, statistics):
    """An offline page; its pictures lie beside it."""
    title = html.escape(os.path.basename(recipe.path))
    rows = [(html.escape(part), [f"<td>{text_of(figures)}</td>" for text_of in COLUMNS.values()])
            for part, figures in statistics.items()]
    return page(title, title, STYLE, [f"<th>{name}</th>" for name in COLUMNS], rows,
                "<p>For each video, the busiest of a few frame intervals: ON white, OFF blue. Click to enlarge.</p>"
                f'<div class="videos">{"".join(map(figure_of, made))}</div>')


def figure_of(record):
    figures = record["figures"]
    parts = [record["split"], f"{figures['width']} × {figures['height']} pixels", f"{figures['frames']} frames",
             duration_text(figures["duration"]), f"{figures['mean-rate'] / 1e6:.3f} Mev/s",
             *(f"{name} {value}" for name, value in record["parameters"].items())]
    picture = html.escape("previews/" + urllib.parse.quote(record["name"]) + ".png")
    return (f'<figure><a href="{picture}"><img loading="lazy" src="{picture}" alt="events"></a>'
            f"<figcaption><b>{html.escape(record['name'])}</b><br>{html.escape(', '.join(filter(None, parts)))}"
            "</figcaption></figure>")
