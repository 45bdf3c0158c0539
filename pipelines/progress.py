# SPDX-License-Identifier: LGPL-2.1-or-later
"""Telling how far a program has come."""
import sys


class Progress:
    """One line, overwritten, on a terminal; a line per step elsewhere."""

    def __init__(self):
        self.on_terminal = sys.stderr.isatty()

    def tell(self, text):
        print(f"\r{text:<78}" if self.on_terminal else text, end="" if self.on_terminal else "\n", file=sys.stderr,
              flush=True)

    def end(self):
        if self.on_terminal:
            print(file=sys.stderr)
