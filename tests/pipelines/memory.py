#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""A file of n bytes costs no reader, player or statistic more than 400 MB + 50 n; two cost a comparison
twice as much.

The files are tiny, and state or suggest a sensor of up to 16384x16384 pixels, or expand to millions
of events.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

import scratch  # noqa: F401  first
import gst_eventcamera as ec
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


def columns(t, x, y):
    """The fields of events of both polarities by turns."""
    return {"t": numpy.array(t, numpy.int64), "x": numpy.array(x, numpy.uint16), "y": numpy.array(y, numpy.uint16),
            "p": numpy.arange(len(t), dtype=numpy.uint8) % 2}


def table(fields):
    """A structured array of fields."""
    return numpy.rec.fromarrays(list(fields.values()), names=list(fields))


def scattered(side, count):
    random = numpy.random.default_rng(1)
    return columns(100 * numpy.arange(count), *random.integers(0, side, (2, count)))


def write_csv(path, fields):
    numpy.savetxt(path, numpy.transpose(list(fields.values())), "%d", ",", header="t,x,y,p", comments="")


def make_files():
    """Writes the files to the current folder."""
    few = columns([1, 2, 3], [10, 16000, 5], [10, 16000, 5])
    max_guessed = scattered(4096, 2000)
    wide = scattered(MAX_SIDE, 2000)
    at_once = columns(*numpy.full((3, 10_000_000), [[0], [5], [5]]))
    write_csv("few.csv", few)
    write_csv("beyond.csv", columns([1, 2, 3], [10, 20000, 5], [10, 20000, 5]))
    write_csv("guessed.csv", max_guessed)
    numpy.save("few.npy", table(few))
    numpy.save("guessed.npy", table(max_guessed))
    numpy.savez("few.npz", **few)
    numpy.savez("guessed.npz", **max_guessed)
    numpy.savez("stated.npz", width=MAX_SIDE, height=MAX_SIDE, **wide)
    numpy.savez_compressed("at-once.npz", **at_once)
    for path, fields, side in (("stated.dat", wide, MAX_SIDE), ("stated.h5", wide, MAX_SIDE), ("at-once.h5", at_once, 640)):
        ec.write(path, table(fields), side, side)


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
