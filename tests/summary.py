#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the totals of a test run: passed, failed and skipped."""
import collections
import json
import sys

with open(sys.argv[1], encoding="utf-8") as log:
    results = collections.Counter(json.loads(line)["result"] for line in log)
skipped = results.pop("SKIP", 0)
passed = results.pop("OK", 0) + results.pop("EXPECTEDFAIL", 0)
print(f"{passed} passed, {sum(results.values())} failed, {skipped} skipped")
