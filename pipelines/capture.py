# SPDX-License-Identifier: LGPL-2.1-or-later
"""What the servers show: a camera, or without one a test scene, until Ctrl-C."""
import signal

from gi.repository import GLib, Gst

SCENE = "videotestsrc is-live=true pattern=ball"
# By default v4l2src selects the largest frames, which many cameras deliver only a few times a second.
CAMERA = ("v4l2src name=camera ! video/x-raw,width=[1,640],height=[1,480];"
          "image/jpeg,width=[1,640],height=[1,480] ! decodebin")


class Capture:
    """A pipeline of a camera, or of the test scene, and `launch`. on_element_message(message) is
    called for the messages of its elements."""

    def __init__(self, device, launch, on_element_message=None):
        # Frames that come too fast are dropped, so that latency does not grow.
        self.pipeline = Gst.parse_launch(f"{CAMERA if device else SCENE}"
                                         f" ! queue leaky=downstream max-size-buffers=2 ! {launch}")
        if device:
            self.pipeline.get_by_name("camera").set_property("device", device)
        self.on_element_message = on_element_message

    def start(self):
        if self.pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
            message = self.pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
            self.pipeline.set_state(Gst.State.NULL)
            raise RuntimeError(described(message))

    def run(self):
        """Returns at Ctrl-C or SIGTERM; raises RuntimeError if the pipeline fails."""
        loop = GLib.MainLoop()
        failures = []

        def receive(_, message):
            if message.type == Gst.MessageType.ELEMENT and self.on_element_message:
                self.on_element_message(message)
            elif message.type in (Gst.MessageType.ERROR, Gst.MessageType.EOS):
                failures.append(described(message))
                loop.quit()

        bus = self.pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect("message", receive)
        for number in (signal.SIGINT, signal.SIGTERM):
            GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, number, loop.quit)
        loop.run()
        bus.remove_signal_watch()
        self.pipeline.set_state(Gst.State.NULL)
        if failures:
            raise RuntimeError(failures[0])


def described(message):
    if message.type == Gst.MessageType.EOS:
        return "the camera has stopped"
    error, _ = message.parse_error()
    return f"{message.src.get_name()}: {error.message}"
