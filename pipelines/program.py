# SPDX-License-Identifier: LGPL-2.1-or-later
"""What the programs share: options, progress, errors, pages, and finding plugins."""
import argparse
import os
import sys
import time

from gi.repository import GLib, Gst

VERSION = "@VERSION@"


def option_parser(description, **more):
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter, **more)
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}", help="print the version and exit")
    return parser


def find_plugins(names=("eventcam", "eventsim")):
    for plugin in names:
        if not Gst.Registry.get().find_plugin(plugin):
            raise RuntimeError(
                f"GStreamer does not find the plugin {plugin}. In a checkout, enter the development shell:"
                " meson devenv -C build -w .\nOtherwise install it: the Debian package"
                f" gstreamer1.0-{plugin}, or as root: meson install -C build")


def find_elements(names, packages):
    if missing := [name for name in names if not Gst.ElementFactory.find(name)]:
        raise RuntimeError(f"GStreamer has no {', '.join(missing)}; on Debian, install: {packages}")


def pyplot_for(option):
    """Matplotlib, which few options need."""
    try:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        raise RuntimeError(f"{option} needs Matplotlib; on Debian, install: python3-matplotlib") from None
    matplotlib.rcParams["svg.fonttype"] = "none"
    return pyplot


def run(main):
    """Runs a program, and exits."""
    try:
        sys.exit(main())
    except (RuntimeError, OSError, GLib.Error) as failure:
        sys.exit(f"error: {failure}")
    except KeyboardInterrupt:
        sys.exit(130)


class Progress:
    """A line that is rewritten on a terminal, `pause` seconds apart; elsewhere a line every `interval` seconds."""

    def __init__(self, interval, pause=0):
        self.on_terminal = sys.stderr.isatty()
        self._wait = pause if self.on_terminal else interval
        self._last = time.monotonic()
        self.prefix = ""  # of each line

    def update(self, text):
        if time.monotonic() < self._last + self._wait:
            return
        self._last = time.monotonic()
        text = self.prefix + text
        if self.on_terminal:
            width = (os.get_terminal_size(sys.stderr.fileno()).columns or 80) - 1
            text = f"\r{text[:width]:<{width}}"
        print(text, end="" if self.on_terminal else "\n", file=sys.stderr, flush=True)

    def print(self, text):
        """Prints a line that stays."""
        self.clear()
        print(text, file=sys.stderr, flush=True)
        self._last = time.monotonic()

    def clear(self):
        """Removes the line of progress from a terminal."""
        if self.on_terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def page(title, heading, style, header, rows, rest):
    """An HTML page of its own that starts with a table: the cells of its header, and the heading and cells of rows."""
    lines = "".join(f"<tr><th>{name}</th>{''.join(cells)}</tr>" for name, cells in rows)
    return (f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
            f"<title>{title}</title><style>{PAGE_STYLE}{style}</style><h1>{heading}</h1>"
            f"<table><tr><th></th>{''.join(header)}</tr>{lines}</table>{rest}\n")


PAGE_STYLE = """
:root { color-scheme: light dark; font-family: sans-serif }
body { max-width: 75rem; margin: 1.5rem auto; padding: 0 1rem }
table { border-collapse: collapse } th, td { padding: .2rem .8rem; text-align: right } th:first-child { text-align: left }
tr:nth-child(even) { background: #8882 } figure { margin: 0 }
"""
