# SPDX-License-Identifier: LGPL-2.1-or-later
"""Options of the event servers, and their source: a camera, a test scene, a file or a pipeline, until Ctrl-C."""
import argparse
import ipaddress
import os
import re
import signal
import socket
import threading

from urllib.parse import urlsplit

from gi.repository import GLib, Gst

from program import option_parser

SCENE = "videotestsrc is-live=true pattern=ball"
# The default of v4l2src is the largest frame size, which many cameras deliver only a few times a second.
CAMERA = ("v4l2src name=camera ! video/x-raw,width=[1,640],height=[1,480];"
          "image/jpeg,width=[1,640],height=[1,480] ! decodebin")
EVENTS = "application/x-event-camera"
DECODED = 'uridecodebin uri="{uri}" caps="{caps}" expose-all-streams=false'


def server_options(name, description, address, port):
    parser = option_parser(description, prog=name)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--device", help="camera, such as /dev/video0 (default: a test scene)")
    source.add_argument("--source", help="instead of a camera: a video or a recording of events, which is repeated; an"
                        ' address such as rtsp://camera/stream; or a pipeline, such as "v4l2src ! videoflip method=clockwise"')
    add_simulator(parser)
    parser.add_argument("--address", type=ipaddress.ip_address, default=address,
                        help="IP address to listen on (default: %(default)s)")
    parser.add_argument("--port", type=port_number, default=port,
                        help="0 = any free port (default: %(default)s)")
    return parser


def add_simulator(parser):
    parser.add_argument("--simulator", default="eventsim-dvs", type=for_webcams,
                        help='simulator and its properties, such as "eventsim-sparse positive-threshold=5"'
                        " (default: %(default)s)")


def for_webcams(simulator):
    """A simulator that skips frames that a camera repeats, unless its properties say otherwise."""
    return re.sub(r"^((gl)?eventsim-\S+)", r"\1 skip-repeated=true", simulator)


def port_number(text):
    if not 0 <= int(text) < 65536:
        raise argparse.ArgumentTypeError(f"{text} is not a port number")
    return int(text)


def host_of(address):
    """Host part of URLs."""
    if address.is_unspecified:
        return socket.gethostname()
    return f"[{address}]" if address.version == 6 else str(address)


class Source:
    """What a server captures. Has the attributes launch, a part of a pipeline; name, for viewers; has_events, for a
    recording; and is_file. Raises RuntimeError or GLib.Error."""

    def __init__(self, device, source):
        self.name, self.launch = device or "test scene", CAMERA if device else SCENE
        self.has_events = self.is_file = False
        if source is None:
            return
        if " ! " in source:
            self.name, self.launch = "pipeline", source
            output = Gst.parse_bin_from_description(source, True).get_static_pad("src")
            self.has_events = not output or output.query_caps(None).can_intersect(Gst.Caps.from_string(EVENTS))
            return
        self.is_file = "://" not in source
        if self.is_file and not os.path.isfile(source):
            raise RuntimeError(f"{source} is no file; give a file, an address, or a pipeline: elements joined by \" ! \"")
        self.name = os.path.basename(source) if self.is_file else urlsplit(source).hostname  # without a password
        self.has_events = self.is_file and source.lower().endswith(tuple(
            "." + extension for finder in Gst.TypeFindFactory.get_list() if finder.get_plugin_name() == "eventcam"
            for extension in finder.get_extensions() or ()))
        self.launch = DECODED.format(
            uri=Gst.filename_to_uri(source) if self.is_file else source.replace('"', "%22"),
            caps=f"{EVENTS},format=XYTP" if self.has_events else "video/x-raw")


class Capture:
    """Pipeline from a Source through `launch`. Its output is pushed to all attached appsrcs.
    on_element_message(message) is called for messages of its elements."""

    def __init__(self, device, source, launch, on_element_message=None):
        # The queue drops frames that arrive too fast, so latency does not grow. The appsrcs know no segments, and times
        # of a file that is repeated must not go back for encoders: with single-segment, they are running times.
        self._is_file = source.is_file
        leaky = "no" if source.is_file or source.has_events else "downstream"
        self.pipeline = Gst.parse_launch(
            f"{source.launch} ! queue leaky={leaky} max-size-buffers=2"
            f" ! identity single-segment=true sync={source.is_file} ! {launch}"
            " ! appsink name=captured emit-signals=true sync=false")
        if device:
            self.pipeline.get_by_name("camera").set_property("device", device)
        self.pipeline.get_by_name("captured").connect("new-sample", self._push)
        self._appsrcs = ()  # replaced, never modified: the streaming thread reads it
        self._attaching = threading.Lock()
        self._on_element_message = on_element_message
        self._loop = GLib.MainLoop()

    def attach(self, appsrc, pipeline):
        """Feeds `appsrc`, whose `pipeline` gets the capture's clock and base time."""
        pipeline.use_clock(self.pipeline.get_clock())
        pipeline.set_start_time(Gst.CLOCK_TIME_NONE)
        pipeline.set_base_time(self.pipeline.get_base_time())
        with self._attaching:
            self._appsrcs += (appsrc,)

    def detach(self, appsrc):
        with self._attaching:
            self._appsrcs = tuple(other for other in self._appsrcs if other is not appsrc)

    def start(self):
        bus = self.pipeline.get_bus()
        failed = self.pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE
        message = bus.pop_filtered(Gst.MessageType.ERROR) if failed else None
        if self._is_file and not failed:
            message = bus.timed_pop_filtered(20 * Gst.SECOND, Gst.MessageType.STREAM_START | Gst.MessageType.ERROR)
        if failed or self._is_file and (not message or message.type == Gst.MessageType.ERROR):
            self.pipeline.set_state(Gst.State.NULL)
            raise RuntimeError(described(message) if message else "the source has no video and no events")
        if self._is_file:
            self._play_from_start(Gst.SeekFlags.FLUSH)
            self.pipeline.get_state(Gst.SECOND)
        for number in (signal.SIGINT, signal.SIGTERM):
            GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, number, self._loop.quit)

    def run(self):
        """Returns at Ctrl-C or SIGTERM; raises RuntimeError if the pipeline fails."""
        failures = []

        def receive(_, message):
            if message.type == Gst.MessageType.ELEMENT and self._on_element_message:
                self._on_element_message(message)
            elif message.type == Gst.MessageType.SEGMENT_DONE:
                self._play_from_start(Gst.SeekFlags.NONE)
            elif message.type in (Gst.MessageType.ERROR, Gst.MessageType.EOS):
                failures.append(described(message))
                self._loop.quit()

        bus = self.pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect("message", receive)
        self._loop.run()
        bus.remove_signal_watch()
        self.pipeline.set_state(Gst.State.NULL)
        if failures:
            raise RuntimeError(failures[0])

    def _play_from_start(self, flags):
        """Seeks so that a file continues at its start after its end."""
        self.pipeline.seek(1, Gst.Format.TIME, flags | Gst.SeekFlags.SEGMENT, Gst.SeekType.SET, 0, Gst.SeekType.NONE, 0)

    def _push(self, appsink):
        sample = appsink.emit("pull-sample")
        for appsrc in self._appsrcs:
            appsrc.emit("push-sample", sample)
        return Gst.FlowReturn.OK


def described(message):
    if message.type == Gst.MessageType.EOS:
        return "the source has ended; check that the camera is connected, and start again"
    error, _ = message.parse_error()
    return f"{message.src.get_name()}: {error.message}"
