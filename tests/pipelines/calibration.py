#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""A camera of known focal length looks at a chessboard that moves: calibrate_camera.py finds it from the events."""
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

import numpy as np

WIDTH, HEIGHT, FRAMES, RATE = 400, 300, 270, 60
FOCAL, CENTRE = 330.0, np.array([205.0, 146.0])
SAMPLES = 2  # of a pixel, along each side


def turned(axis, angle):
    """Rotation about an axis."""
    cos, sin = np.cos(angle), np.sin(angle)
    rotation = np.eye(3)
    others = [i for i in range(3) if i != axis]
    rotation[np.ix_(others, others)] = [[cos, -sin], [sin, cos]]
    return rotation


def frame(time, rays):
    """A board of 10 x 7 squares with a white margin, in front of a grey wall."""
    def swing(amplitude, frequency, phase):
        return amplitude * np.sin(2 * np.pi * frequency * time + phase)

    rotation = turned(2, swing(0.3, 0.17, 2)) @ turned(1, swing(0.45, 0.23, 1)) @ turned(0, swing(0.45, 0.31, 0))
    position = np.array([swing(2.2, 0.41, 0), swing(1.6, 0.37, 0.5), 14 + swing(2.5, 0.19, 0)])
    normal = rotation[:, 2]
    points = rays * ((normal @ position) / (rays @ normal))[..., None] - position
    x, y = points @ rotation[:, 0], points @ rotation[:, 1]
    squares = np.where((np.floor(x) + np.floor(y + 3.5)) % 2 > 0, 230, 25)
    light = np.where((abs(x) < 5) & (abs(y) < 3.5), squares, np.where((abs(x) < 6) & (abs(y) < 4.5), 230, 110))
    return light.reshape(HEIGHT, SAMPLES, WIDTH, SAMPLES).mean(axis=(1, 3)).round().astype(np.uint8)


def main():
    y, x = np.mgrid[0 : HEIGHT * SAMPLES, 0 : WIDTH * SAMPLES]
    pixels = (np.stack([x, y], axis=-1) + 0.5) / SAMPLES - 0.5
    rays = np.concatenate([(pixels - CENTRE) / FOCAL, np.ones(x.shape + (1,))], axis=-1)
    with tempfile.TemporaryDirectory() as folder:
        recording, calibration = (os.path.join(folder, name) for name in ("board.raw", "camera.xml"))
        simulation = subprocess.Popen(
            [os.environ["GST_LAUNCH"], "-q", "fdsrc", f"blocksize={WIDTH * HEIGHT}", "!", "rawvideoparse", "format=gray8",
             f"width={WIDTH}", f"height={HEIGHT}", f"framerate={RATE}/1", "!", "eventsim-dvs", "!", "evtenc", "!",
             "filesink", f"location={recording}"], stdin=subprocess.PIPE)
        for number in range(FRAMES):
            simulation.stdin.write(frame(number / RATE, rays).tobytes())
        simulation.stdin.close()
        if simulation.wait() != 0:
            sys.exit("FAILED: the simulation")
        subprocess.run([os.path.join(os.environ["SOURCE"], "pipelines", "examples", "calibrate_camera.py"), recording,
                        calibration], check=True)
        matrix = xml.etree.ElementTree.parse(calibration).find("cameraMatrix/data").text
        # A calibration that eventundistort does not take is an error.
        subprocess.run([os.environ["GST_LAUNCH"], "-q", "filesrc", f"location={recording}", "!", "evtdec", "!",
                        "eventundistort", f"location={calibration}", "!", "fakesink"], check=True)
    found = np.array([float(number) for number in matrix.split()])[[0, 4, 2, 5]]
    known = np.array([FOCAL, FOCAL, *CENTRE])
    print("focal lengths and centre:", found, "instead of", known)
    if (abs(found / known - 1) > 0.01).any():
        sys.exit("FAILED: off by more than 1 %")


main()
