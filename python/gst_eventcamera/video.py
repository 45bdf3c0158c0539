# SPDX-License-Identifier: LGPL-2.1-or-later
"""Frames of videos as a person sees them: upright, deinterlaced, and a looping one once; otherwise unchanged."""
from __future__ import annotations

import os

from .pipeline import GLib, Gst, GstEventCamera, Pipeline, quoted

# The converters pass all formats that simulators read unchanged, and so does deinterlace unless video is interlaced.
_FRAMES = "videoconvert name=decoded ! deinterlace ! videoconvert name=frames"


class VideoPipeline(Pipeline):
    """A pipeline of the elements `source`, such as "appsrc", and `rest`, which process the frames. Its element
    `decoded` passes the decoded frames."""

    def __init__(self, source: str, rest: str) -> None:
        super().__init__(f"{source} ! {_FRAMES} ! {rest}")
        self._tags = self.element("frames").get_static_pad("sink").add_probe(
            Gst.PadProbeType.EVENT_DOWNSTREAM, self._turn_upright)

    def _turn_upright(self, pad: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
        """Inserts videoflip once tags say that the video is rotated; not before, because it accepts fewer formats than
        simulators."""
        event = info.get_event()
        if event.type != Gst.EventType.TAG:
            return Gst.PadProbeReturn.OK
        given, orientation = event.parse_tag().get_string(Gst.TAG_IMAGE_ORIENTATION)
        if not given or orientation == "rotate-0":
            return Gst.PadProbeReturn.OK
        pad.remove_probe(self._tags)
        upright = Gst.parse_bin_from_description("videoconvert ! videoflip video-direction=auto", True)
        self._pipeline.add(upright)
        before = pad.get_peer()
        before.unlink(pad)
        before.link(upright.get_static_pad("sink"))
        upright.get_static_pad("src").link(pad)
        upright.sync_state_with_parent()
        before.push_event(event)
        return Gst.PadProbeReturn.DROP


def _are_events(caps: Gst.Caps) -> bool:
    return caps.get_structure(0).get_name() == GstEventCamera.MEDIA_TYPE


class VideoFile(VideoPipeline):
    """A pipeline of a video file, or of the frames of a file with frames and events."""

    def __init__(self, path: str | os.PathLike[str], rest: str) -> None:
        super().__init__(f"filesrc location={quoted(path)} ! decodebin name=decoder", rest)
        self.has_only_events = False
        decoder = self.element("decoder")
        decoder.connect("autoplug-select", self._select)
        decoder.connect("no-more-pads", self._expect_frames)
        self._left = _pictures_of_gif(path)
        if self._left > 0:
            self.element("decoded").get_static_pad("sink").add_probe(Gst.PadProbeType.BUFFER, self._end_loop)

    @staticmethod
    def _select(decoder: Gst.Element, pad: Gst.Pad, caps: Gst.Caps, factory: Gst.ElementFactory) -> int:
        """Leaves events as they are: drawn, they would be taken for the frames if they come first in the file.
        Returns a GstAutoplugSelectResult, which has no introspection data."""
        try_factory, expose_pad = 0, 1
        return expose_pad if _are_events(caps) else try_factory

    def _expect_frames(self, decoder: Gst.Element) -> None:
        pads = decoder.srcpads
        self.has_only_events = (any(_are_events(pad.get_current_caps()) for pad in pads)
                                and not any(pad.is_linked() for pad in pads))
        if self.has_only_events:
            error = GLib.Error.new_literal(Gst.StreamError.quark(), "This file has events, but no frames.",
                                           Gst.StreamError.WRONG_TYPE)
            decoder.post_message(Gst.Message.new_error(decoder, error, "no video pad"))

    def _end_loop(self, pad: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
        """Ends the video after its last picture. The GIF demuxer of gst-libav 1.22 does not: its gst_ffmpegdata_read()
        returns 0 at the end of the file, and libavformat tries again."""
        self._left -= 1
        if self._left != 0:
            return Gst.PadProbeReturn.OK
        pad.chain(info.get_buffer())
        pad.send_event(Gst.Event.new_eos())
        return Gst.PadProbeReturn.DROP


def _pictures_of_gif(path: str | os.PathLike[str]) -> int:
    """Number of complete pictures of a GIF; 0 for other files."""
    try:
        with open(path, "rb") as file:
            data = file.read() if file.read(4) == b"GIF8" else b""
    except OSError:  # the pipeline reports it
        data = b""

    def table_size(flags: int) -> int:
        return 3 << (flags & 7) + 1 if flags & 0x80 else 0

    count = 0
    try:
        at = 9 + table_size(data[6])
        while data[at] != 0x3b:
            is_picture = data[at] == 0x2c
            at += 11 + table_size(data[at + 9]) if is_picture else 2
            while data[at] > 0:  # sub-blocks
                at += data[at] + 1
            at += 1
            count += is_picture
    except IndexError:
        pass
    return count
