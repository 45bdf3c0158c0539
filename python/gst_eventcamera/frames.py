# SPDX-License-Identifier: LGPL-2.1-or-later
"""The frames that a video is decoded to: whether they are complete and intact."""
from __future__ import annotations

import numpy as np

from .pipeline import Gst

# A video that lasts so much less than its file says, in seconds and as a share, was cut off, unless other streams of
# the file go on for so many seconds.
CUT_OFF = 1.0, 0.1
# Intervals between frames may differ so much from their median; containers round times to milliseconds.
STEADY = 0.25


class Frames:
    """What is to know of the frames of a video, from their times and flags.

    times: PTS of the frames, in nanoseconds.
    corrupted: how many have the flag CORRUPTED.
    shown: for how long the last one is, in nanoseconds; 0 if not known.
    others_end: that of the other streams of the file, such as audio, in nanoseconds; 0 if there are none."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.corrupted = self.shown = self.others_end = 0

    def watch(self, pad: Gst.Pad) -> None:
        def look(_: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
            self.add(info.get_buffer())
            return Gst.PadProbeReturn.OK

        pad.add_probe(Gst.PadProbeType.BUFFER, look)
        self.watch_others(pad)

    def add(self, buffer: Gst.Buffer) -> None:
        self.times.append(buffer.pts)
        self.corrupted += buffer.has_flags(Gst.BufferFlags.CORRUPTED)
        self.shown = buffer.duration if buffer.duration != Gst.CLOCK_TIME_NONE else 0

    def watch_others(self, pad: Gst.Pad) -> None:
        """Watches the other streams of the file whose frames pass the pad."""
        def look_at_other(_: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
            if info.get_buffer().pts != Gst.CLOCK_TIME_NONE:
                self.others_end = max(self.others_end, info.get_buffer().pts)
            return Gst.PadProbeReturn.OK

        def watch_other(_: Gst.Element, stream: Gst.Pad) -> None:
            caps = stream.get_current_caps()
            if caps and not caps.get_structure(0).get_name().startswith(("video/", "image/")):
                stream.add_probe(Gst.PadProbeType.BUFFER, look_at_other)

        def watch_demuxer(_: Gst.Bin, __: Gst.Bin, element: Gst.Element) -> None:
            if "Demuxer" in element.get_metadata("klass"):
                element.connect("pad-added", watch_other)

        pad.get_parent_element().get_parent().connect("deep-element-added", watch_demuxer)

    def fault(self, min_frames: int, duration: float, pictures: int) -> str:
        """Why the video cannot be used, such as "corrupt: 2 of 90 frames"; empty if it can.

        duration: that of the file, in seconds; 0 if not known.
        pictures: number of pictures in the folder; 0 if it is a file."""
        count = len(self.times)
        if pictures > 0 and count != pictures:
            return f"corrupt: {count} of its {pictures} pictures can be decoded"
        if self.corrupted > 0:
            return f"corrupt: {self.corrupted} of {count} frames"
        if count < min_frames:
            return f"too short: {count} frames of at least {min_frames}"
        end = self.times[-1] + max(self.shown, self.times[-1] - self.times[-2])
        missing = duration - (end - self.times[0]) / 1e9
        if missing > CUT_OFF[0] and missing > CUT_OFF[1] * duration and self.others_end - end <= CUT_OFF[0] * 1e9:
            return f"corrupt: its frames end {missing:.1f} s before the {duration:.1f} s of the file"
        return ""

    def warnings(self) -> list[str]:
        """What is unusual of a video that can be used."""
        intervals = np.diff(np.array(self.times, np.int64)) / 1e6
        if np.ptp(intervals) > 2 * STEADY * np.median(intervals):
            return [f"variable framerate: its frames are {intervals.min():.0f} to {intervals.max():.0f} ms apart;"
                    " the times of the events follow them"]
        return []
