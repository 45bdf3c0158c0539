#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes a file of N-MNIST, from its description alone, and the same events as text and as a file of
MATLAB:

    n_mnist.py DIRECTORY"""
import random
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


def matlab(path, some):
    """As the functions of N-MNIST for MATLAB return them: all counts from 1, and ON is 2."""
    t, x, y, p = np.array(some, float).T
    scipy.io.savemat(path, {"TD": {"x": x + 1, "y": y + 1, "p": p + 1, "ts": t}})


def main():
    folder = Path(sys.argv[1])
    small = list(events(2000, 34, 34))
    (folder / "n-mnist.bin").write_bytes(n_mnist(small))
    lines = ["t,x,y,p"] + [",".join(map(str, event)) for event in small]
    (folder / "n-mnist.bin.lines").write_text("\n".join(lines) + "\n")
    matlab(folder / "n-mnist.mat", small)


main()
