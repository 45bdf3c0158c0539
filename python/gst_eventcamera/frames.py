# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks that the decoded frames of a video are complete and intact."""
from __future__ import annotations

import numpy as np

from .pipeline import Gst

# A video is truncated if it is shorter than its file states by more than these seconds and this share, unless other
# streams outlast its frames by more than these seconds.
CUT_OFF = 1.0, 0.1
# Maximum deviation of a frame interval from the median, as a share; containers round times to milliseconds.
STEADY = 0.25


class Frames:
    """Times and flags of the frames of a video.

    times: PTS of the frames, in nanoseconds.
    corrupted: number of frames with the flag CORRUPTED.
    last_duration: of the last frame, in nanoseconds; 0 = unknown.
    others_end: last PTS of the other streams of the file, such as audio, in nanoseconds; 0 = none."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.corrupted = self.last_duration = self.others_end = 0

    def watch(self, pad: Gst.Pad) -> None:
        """Watches the frames that pass a pad, and the other streams of their file."""
        def add_frame(_: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
            buffer = info.get_buffer()
            self.times.append(buffer.pts)
            self.corrupted += buffer.has_flags(Gst.BufferFlags.CORRUPTED)
            self.last_duration = buffer.duration if buffer.duration != Gst.CLOCK_TIME_NONE else 0
            return Gst.PadProbeReturn.OK

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

        pad.add_probe(Gst.PadProbeType.BUFFER, add_frame)
        pad.get_parent_element().get_parent().connect("deep-element-added", watch_demuxer)

    def fault(self, min_frames: int, duration: float, pictures: int) -> str:
        """Why the video cannot be used, such as "corrupt: 2 of 90 frames"; empty if it can.

        duration: of the file, in seconds; 0 = unknown.
        pictures: number of pictures in the folder; 0 for a file."""
        count = len(self.times)
        if pictures > 0 and count != pictures:
            return f"corrupt: {count} of its {pictures} pictures can be decoded"
        if self.corrupted > 0:
            return f"corrupt: {self.corrupted} of {count} frames"
        if count < min_frames:
            return f"too short: {count} frames of at least {min_frames}"
        end = self.times[-1] + max(self.last_duration, self.times[-1] - self.times[-2])
        missing = duration - (end - self.times[0]) / 1e9
        if missing > CUT_OFF[0] and missing > CUT_OFF[1] * duration and self.others_end - end <= CUT_OFF[0] * 1e9:
            return f"corrupt: its frames end {missing:.1f} s before the {duration:.1f} s of the file"
        return ""

    def warnings(self) -> list[str]:
        """Unusual properties of a video that can be used all the same."""
        intervals = np.diff(np.array(self.times, np.int64)) / 1e6
        if np.ptp(intervals) > 2 * STEADY * np.median(intervals):
            return [f"variable framerate: its frames are {intervals.min():.0f} to {intervals.max():.0f} ms apart;"
                    " the times of the events follow them"]
        return []
