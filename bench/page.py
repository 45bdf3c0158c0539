# SPDX-License-Identifier: LGPL-2.1-or-later
"""Replaces the tables in pages of docs/; shared by the scripts here."""
import re
import sys


def replace_tables(path, source, text):
    """Replaces what a page has between "tables of SOURCE" and "end of the tables"."""
    with open(path, encoding="utf-8") as file:
        page = file.read()
    begin, end = f"<!-- tables of {source} -->\n", "<!-- end of the tables -->\n"
    between = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if not between.search(page):
        sys.exit(f"{path}: no marker '{begin.strip()}'; add it where the tables belong")
    with open(path, "w", encoding="utf-8") as file:
        file.write(between.sub(lambda _: f"{begin}\n{text}\n{end}", page))


def run_on(context):
    """Date and machine of a run of Google Benchmark."""
    vectors = f" with {context['vectors']}" if "vectors" in context else ""
    return (f"Run on {context['date'][:10]} on {context['num_cpus']} CPUs{vectors} at"
            f" {context['mhz_per_cpu']} MHz; initial load average"
            f" {context['load_avg'][0]:.1f}.\n")
