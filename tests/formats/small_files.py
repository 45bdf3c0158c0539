#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes files of formats that are only read here, from their descriptions alone, and the events in
them as text; and a file of MATLAB:

    small_files.py DIRECTORY"""
import random
import struct
import sys
from pathlib import Path

import numpy as np
import scipy.io


def events(count, width, height):
    """Sorted (t, x, y, p)."""
    numbers = random.Random(1)
    t = 100
    for _ in range(count):
        t += numbers.randrange(400)
        yield t, numbers.randrange(width), numbers.randrange(height), numbers.randrange(2)


def n_mnist(some):
    """Forty bits, from the highest: x (8), y (8), polarity (1), microseconds (23)."""
    return b"".join((x << 32 | y << 24 | p << 23 | t).to_bytes(5, "big") for t, x, y, p in some)


def aedat1(some):
    """Big-endian: an address of 16 bits, whose columns and rows count from the far corner and whose bit 0 is OFF,
    and microseconds with 32 bits."""
    records = (struct.pack(">Hi", (127 - y) << 8 | (127 - x) << 1 | (1 - p), t) for t, x, y, p in some)
    return b"#!AER-DAT1.0\r\n# This is a raw AE data file - do not edit\r\n" + b"".join(records)


def event_stream(kind, width, height, bodies):
    return b"Event Stream" + bytes([2, 0, 0, kind]) + struct.pack("<HH", width, height) + b"".join(bodies)


def atis(some, height):
    """Of each event, the second after it is the start of an exposure, and rows count from the bottom."""
    last = 0
    for t, x, y, p in some:
        step = t - last
        while step >= 63:
            yield bytes([0xFC | min(step // 63, 3)])
            step -= 63 * min(step // 63, 3)
        yield struct.pack("<BHH", step << 2 | p << 1, x, height - 1 - y)
        yield struct.pack("<BHH", 0 << 2 | 1, x, height - 1 - y)
        last = t


def colour(some, height):
    last = 0
    for t, x, y, _ in some:
        step = t - last
        while step >= 254:
            yield b"\xff"
            step -= 254
        yield struct.pack("<BHHBBB", step, x, height - 1 - y, 1, 2, 3)
        last = t


def matlab(path, some):
    """As the functions of N-MNIST for MATLAB return them: all counts from 1, and ON is 2."""
    t, x, y, p = np.array(some, float).T
    scipy.io.savemat(path, {"TD": {"x": x + 1, "y": y + 1, "p": p + 1, "ts": t}})


def write(folder, name, content, some):
    (folder / name).write_bytes(content)
    lines = ["t,x,y,p"] + [",".join(map(str, event)) for event in some]
    (folder / f"{name}.lines").write_text("\n".join(lines) + "\n")


def main():
    folder = Path(sys.argv[1])
    small = list(events(2000, 34, 34))
    write(folder, "n-mnist.bin", n_mnist(small), small)
    matlab(folder / "n-mnist.mat", small)
    large = list(events(2000, 128, 128))
    write(folder, "first.aedat", aedat1(large), large)
    write(folder, "atis.es", event_stream(2, 128, 128, atis(large, 128)), large)
    on = [(t, x, y, 1) for t, x, y, _ in large]
    write(folder, "colour.es", event_stream(4, 128, 128, colour(large, 128)), on)


main()
