#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""A file of n bytes costs no reader, player or statistic more than 400 MB + 50 n; two cost a comparison
twice as much.

The files are tiny, and state or suggest a sensor of up to 16384x16384 pixels, or expand to millions
of events.
"""

import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

import h5py
import numpy

LAUNCH = os.environ["GST_LAUNCH"]
THUMBNAIL = os.path.join(os.environ["BUILD"], "pipelines", "event-thumbnail")
os.environ.pop("MALLOC_PERTURB_", None)  # else all memory is written when it is allocated
MAX_SIDE = 16384
EVENTS = "application/x-event-camera,format=XYTP"
CHAINS = {
    "player": "playbin uri={uri} video-sink=fakesink",
    "decodebin": "filesrc location={path} ! decodebin ! videoconvert ! video/x-raw,format=I420 ! fakesink",
    "decaying": "filesrc location={path} ! decodebin caps={events} ! eventrender mode=decay ! fakesink",
    "statistics": "filesrc location={path} ! decodebin caps={events} ! eventstats ! fakesink",
    "comparison": "eventcompare name=c ! fakesink filesrc location={path} ! decodebin caps={events} ! c.reference "
    "filesrc location={path} ! decodebin caps={events} ! c.candidate",
}


def scattered(side, count):
    random.seed(1)
    return [(100 * i, random.randrange(side), random.randrange(side), i % 2) for i in range(count)]


def columns(events):
    t, x, y, p = zip(*events)
    return {"t": numpy.array(t, numpy.int64), "x": numpy.array(x, numpy.uint16),
            "y": numpy.array(y, numpy.uint16), "p": numpy.array(p, numpy.uint8)}


def table(events):
    """A structured array with the fields of columns()."""
    fields = columns(events)
    out = numpy.zeros(len(events), [(name, field.dtype) for name, field in fields.items()])
    for name, field in fields.items():
        out[name] = field
    return out


def write_csv(path, events):
    with open(path, "w") as file:
        file.write("t,x,y,p\n")
        file.writelines(f"{t},{x},{y},{p}\n" for t, x, y, p in events)


def write_dat(path, events, side):
    with open(path, "wb") as file:
        file.write(f"% Version 2\n% Width {side}\n% Height {side}\n".encode() + b"\x0c\x08")
        for t, x, y, p in events:
            file.write(struct.pack("<II", t, x | y << 14 | p << 28))


def write_hdf5(path, events, side):
    """The layout of DSEC."""
    with h5py.File(path, "w") as file:
        file.attrs["width"] = file.attrs["height"] = side
        for name, column in columns(events).items():
            file.create_dataset(f"events/{name}", data=column, compression="gzip")


def make_files():
    """Writes the files to the current folder."""
    few = [(1, 10, 10, 1), (2, 16000, 16000, 1), (3, 5, 5, 1)]
    max_guessed = scattered(4096, 2000)
    wide = scattered(MAX_SIDE, 2000)
    at_once = [(0, 5, 5, 1)] * 10_000_000
    write_csv("few.csv", few)
    write_csv("beyond.csv", [(1, 10, 10, 1), (2, 20000, 20000, 1), (3, 5, 5, 1)])
    write_csv("guessed.csv", max_guessed)
    numpy.save("few.npy", table(few))
    numpy.save("guessed.npy", table(max_guessed))
    numpy.savez("few.npz", **columns(few))
    numpy.savez("guessed.npz", **columns(max_guessed))
    numpy.savez("stated.npz", width=MAX_SIDE, height=MAX_SIDE, **columns(wide))
    numpy.savez_compressed("at-once.npz", **columns(at_once))
    write_dat("stated.dat", wide, MAX_SIDE)
    write_hdf5("stated.h5", wide, MAX_SIDE)
    write_hdf5("at-once.h5", at_once, 640)


def peak_of(command):
    """Runs a program. Returns its status and its largest memory in bytes."""
    process = subprocess.Popen(["timeout", "120", *command])
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_maxrss * 1024


def main():
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        # In another process, since its children inherit the peak of its memory.
        if os.fork() == 0:
            make_files()
            os._exit(0)
        if os.wait()[1] != 0:
            sys.exit("the files were not written")
        for name in sorted(os.listdir()):
            size = os.path.getsize(name)
            path = os.path.join(folder, name)
            uri = pathlib.Path(path).as_uri()
            commands = {chain: [LAUNCH, "-q", *(word.format(path=path, uri=uri, events=EVENTS)
                                          for word in line.split())]
                        for chain, line in CHAINS.items()}
            commands["thumbnail"] = [THUMBNAIL, path, path + ".png"]
            for what, command in commands.items():
                bound = max(" ".join(command).count("location="), 1) * (400e6 + 50 * size)
                code, peak = peak_of(command)
                report = f"{name}, {size} bytes, {what}: {peak / 1e6:.0f} of {bound / 1e6:.0f} MB"
                print(report, flush=True)
                if code != 0 or peak > bound:
                    failed.append(f"{report}, status {code}")
    sys.exit("\n".join(failed) or 0)


main()
