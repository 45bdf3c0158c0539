#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Events over RTP, through the elements that people send and protect RTP with: nothing is lost."""
import contextlib
import itertools
import socket
import time
import unittest

import scratch  # noqa: F401  first
import gst_eventcamera as ec
import numpy as np
from gst_eventcamera.pipeline import Gst, events_of
from gst_eventcamera.recordings import buffer_of

from servers import SECONDS

# A second of events in buffers of 10 ms. The sender's times are neither 0 at its start nor whole microseconds.
BUFFERS, EVENTS, ORIGIN = 100, 400, 123_456_789
RTP = ("media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,payload=96,width=346,height=260,format=EVT3")
SOURCE = ("appsrc name=in format=time is-live=true caps=application/x-event-camera,format=XYTP,width=346,height=260"
          " ! identity sync=true")
SINK = "rtpeventdepay name=depay ! appsink name=out sync=false emit-signals=true"
KEY = 60 * "a"
SRTP = (f"application/x-srtp,{RTP},srtp-key=(buffer){KEY},srtp-cipher=aes-128-icm,srtp-auth=hmac-sha1-80,"
        "srtcp-cipher=aes-128-icm,srtcp-auth=hmac-sha1-80")


def events_of_buffer(number):
    i = np.arange(EVENTS)
    events = np.empty(EVENTS, ec.EVENT)
    events["t"] = ORIGIN // 1000 + 10_000 * number + 25 * i
    events["x"] = (31 * number + 17 * i) % 346
    events["y"] = (7 * number + 5 * i) % 260
    events["p"] = i % 3 == 0
    return events


SENT = np.concatenate([events_of_buffer(i) for i in range(BUFFERS)])


def wait_until(condition):
    """For what should happen at once: the machine may be under load."""
    deadline = time.monotonic() + SECONDS
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)


@contextlib.contextmanager
def playing(pipeline):
    pipeline.set_state(Gst.State.PLAYING)
    try:
        yield pipeline
    finally:
        pipeline.set_state(Gst.State.NULL)


def send(pipeline, buffers, received=None):
    """Sends buffers; with `received`, in parts that fit into the receiver's socket, each when the one before has
    arrived, so that a slow machine loses none."""
    for i in buffers:
        if received is not None and i % 10 == 0:
            wait_until(lambda: sum(map(len, received)) >= (i - 10) * EVENTS)
        buffer = buffer_of(events_of_buffer(i), ORIGIN // 1000 + 10_000 * i, 10_000)
        buffer.pts += ORIGIN % 1000
        pipeline.get_by_name("in").emit("push-buffer", buffer)


def receive(pipeline):
    """A list to which the events that arrive are appended."""
    received = []

    def take(sink):
        received.append(events_of(sink.emit("pull-sample")))
        return Gst.FlowReturn.OK

    pipeline.get_by_name("out").connect("new-sample", take)
    return received


def free_ports(count):
    """Consecutive free ports, the first of which is even."""
    for port in range(20000 + int(time.time()) % 1000 * 10, 65000, 10):
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            for i in range(count):
                stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind(("127.0.0.1", port + i))
            return range(port, port + count)
    raise RuntimeError("no free ports")


def retransmission(element):
    """Answers a signal of rtpbin with a bin of an element for session 0."""
    def make(_, session):
        bin_ = Gst.parse_bin_from_description(f"{element} name=rtx", False)
        rtx = bin_.get_by_name("rtx")
        rtx.set_property("payload-type-map", Gst.Structure.from_string("application/x-rtp-pt-map,96=(uint)97")[0])
        for name in ("sink", "src"):
            bin_.add_pad(Gst.GhostPad.new(f"{name}_{session}", rtx.get_static_pad(name)))
        return bin_

    return make


class Rtp(unittest.TestCase):
    def expect_all(self, receiver, received):
        wait_until(lambda: sum(map(len, received)) >= len(SENT))
        self.assertTrue(np.array_equal(np.concatenate(received), SENT))
        self.assertEqual(receiver.get_by_name("depay").get_property("stats").get_uint64("lost-events")[1], 0)

    def test_a_restarted_srtp_sender_is_heard_by_its_new_ssrc(self):
        port, = free_ports(1)
        receiver = Gst.parse_launch(f'udpsrc port={port} caps="application/x-srtp,{RTP}" ! srtpdec name=decrypt ! {SINK}')
        receiver.get_by_name("decrypt").connect("request-key", lambda _, ssrc: Gst.Caps.from_string(SRTP))
        received = receive(receiver)
        with playing(receiver):
            for starts in (1, 2, 3):
                with playing(Gst.parse_launch(f"{SOURCE} ! rtpeventpay ! srtpenc key={KEY}"
                                              f" ! udpsink host=127.0.0.1 port={port}")) as sender:
                    send(sender, range(10))
                    wait_until(lambda: sum(map(len, received)) == starts * 10 * EVENTS)
                self.assertEqual(sum(map(len, received)), starts * 10 * EVENTS)

    def test_retransmission_loses_nothing(self):
        rtp, rtcp, feedback = free_ports(3)
        # The latency bears a loaded machine: packets leave the jitter buffer as soon as none is missing.
        rtpbin = "rtpbin rtp-profile=avpf do-retransmission=true latency=20000 name"
        receiver = Gst.parse_launch(
            f'{rtpbin}=r  udpsrc name=rtp port={rtp} caps="application/x-rtp,{RTP}"  udpsrc port={rtcp}'
            " ! r.recv_rtcp_sink_0  r.send_rtcp_src_0 ! udpsink host=127.0.0.1 sync=false async=false"
            f" port={feedback}  r. ! {SINK}")
        bin_ = receiver.get_by_name("r")
        bin_.connect("request-pt-map", lambda _, session, kind: Gst.Caps.from_string(
            f"application/x-rtp,{RTP}" if kind == 96 else "application/x-rtp,media=application,payload=97,"
            "clock-rate=1000000,encoding-name=RTX,apt=96"))
        bin_.connect("new-jitterbuffer", lambda _, jitterbuffer, session, ssrc: jitterbuffer.set_property(
            "faststart-min-packets", 1))
        # rtpbin asks for these when its pads are requested.
        bin_.connect("request-aux-receiver", retransmission("rtprtxreceive"))
        receiver.get_by_name("rtp").link_pads("src", bin_, "recv_rtp_sink_0")
        sender = Gst.parse_launch(
            f"{rtpbin}=s  {SOURCE} ! rtpeventpay name=pay  identity name=loss ! udpsink host=127.0.0.1 port={rtp}"
            f"  s.send_rtcp_src_0 ! udpsink host=127.0.0.1 sync=false async=false port={rtcp}"
            f"  udpsrc port={feedback} ! s.recv_rtcp_sink_0")
        sender.get_by_name("s").connect("request-aux-sender", retransmission("rtprtxsend max-size-packets=1000"))
        sender.get_by_name("pay").link_pads("src", sender.get_by_name("s"), "send_rtp_sink_0")
        sender.get_by_name("s").link_pads("send_rtp_src_0", sender.get_by_name("loss"), "sink")
        packets = itertools.count(1)
        sender.get_by_name("loss").get_static_pad("src").add_probe(
            Gst.PadProbeType.BUFFER, lambda *_: Gst.PadProbeReturn.DROP if next(packets) in (50, 100)
            else Gst.PadProbeReturn.OK)
        received = receive(receiver)
        with playing(receiver), playing(sender):
            send(sender, range(BUFFERS), received)
            self.expect_all(receiver, received)
        self.assertGreater(next(packets), 100)

    def test_arrives_over_srt(self):
        port, = free_ports(1)
        receiver = Gst.parse_launch(f'srtsrc uri="srt://127.0.0.1:{port}?mode=listener" ! application/x-rtp-stream,{RTP}'
                                    f" ! rtpstreamdepay ! {SINK}")
        received = receive(receiver)
        with playing(receiver), playing(Gst.parse_launch(
                f'{SOURCE} ! rtpeventpay ! rtpstreampay ! srtsink uri="srt://127.0.0.1:{port}?mode=caller"')) as sender:
            send(sender, range(BUFFERS), received)
            self.expect_all(receiver, received)


if __name__ == "__main__":
    unittest.main()
