#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Events between hosts, by RTP and in datagrams of other tools, on good and bad networks: what arrives was sent, what is
lost is counted."""
import os
import time

import gi
import numpy as np

import hosts
from hosts import Conditions, Host, Network

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
from gi.repository import Gst, GstApp  # noqa: E402, F401

EVENT = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_p", "<u2")])
# Two seconds of events in buffers of 10 ms.
BUFFERS, EVENTS_PER_BUFFER, DURATION = 200, 200, 10_000_000
ORIGIN = 123_456_789  # ns: neither 0 nor whole microseconds
RTP = ("media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,payload=96,width=346,height=260,"
       "format=EVT3")
FROM_NETWORK = f'udpsrc name=udp port=5000 buffer-size=2000000 caps="application/x-rtp,{RTP}"'
# Buffers sent at a time: their packets fit into every queue on the way, so a slow machine loses none.
PART = 25
SECONDS = 30  # for anything that should happen at once
IP_AND_UDP = 28  # bytes of headers


def events_of_buffer(number):
    i = np.arange(EVENTS_PER_BUFFER)
    events = np.zeros(EVENTS_PER_BUFFER, EVENT)
    events["t"] = i * 50
    events["x"] = (number * 31 + i * 17) % 346
    events["y_p"] = (number * 7 + i * 5) % 260 | np.where(i % 3 == 0, 0x8000, 0)
    return events


def absolute(start, events):
    """Event times in microseconds, x, and y with polarity, one row per event."""
    return np.stack([start // 1000 + events["t"].astype(np.int64), events["x"], events["y_p"]], axis=1)


def sent(first=0, end=BUFFERS):
    return np.concatenate([absolute(ORIGIN + i * DURATION, events_of_buffer(i)) for i in range(first, end)])


def wait_until(happened, what):
    deadline = time.monotonic() + SECONDS
    while not happened():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


class Player:
    def __init__(self, launch):
        Gst.init(None)
        self._launch = launch
        self._pipeline = None
        self.start()

    def start(self):
        self._pipeline = Gst.parse_launch(self._launch)
        if storage := self._pipeline.get_by_name("storage"):
            self._pipeline.get_by_name("fec").set_property("storage", storage.get_property("internal-storage"))
        self._pipeline.set_state(Gst.State.PLAYING)

    def stop(self):
        self._pipeline.set_state(Gst.State.NULL)

    def stat(self, field):
        return self._pipeline.get_by_name("counting").get_property("stats").get_uint64(field)[1]

    def resident_size(self):
        """In bytes."""
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Sender(Player):
    def __init__(self, to, options="", payloader="rtpeventpay"):
        super().__init__(
            "appsrc name=in format=time is-live=true caps=application/x-event-camera,format=XYTP,width=346,height=260"
            f" ! identity sync=true ! {payloader} name=counting {options} ! {to}")

    def send(self, first, end):
        """Returns when the payloader has sent all."""
        appsrc = self._pipeline.get_by_name("in")
        for i in range(first, end):
            buffer = Gst.Buffer.new_wrapped(events_of_buffer(i).tobytes())
            buffer.pts, buffer.duration = ORIGIN + i * DURATION, DURATION
            appsrc.push_buffer(buffer)
        wait_until(lambda: self.stat("events") >= end * EVENTS_PER_BUFFER, f"sender has sent {self.stat('events')}")

    def datagrams(self):
        """Number of datagrams that were sent."""
        udp = self._pipeline.get_by_name("udp")
        return udp.emit("get-stats", udp.get_property("host"), udp.get_property("port")).get_uint64("packets-sent")[1]

    def stop(self):
        """Returns when the last packet is sent."""
        self._pipeline.get_by_name("in").end_of_stream()
        self._pipeline.get_bus().timed_pop_filtered(SECONDS * Gst.SECOND, Gst.MessageType.EOS)
        super().stop()


class Receiver(Player):
    def __init__(self, launch=f"{FROM_NETWORK} ! rtpeventdepay name=counting", sink=""):
        self._received = [np.zeros((0, 3), np.int64)]
        super().__init__(f"{launch} ! appsink name=out sync=false async=false {sink}")

    def events(self):
        appsink = self._pipeline.get_by_name("out")
        while sample := appsink.try_pull_sample(0):
            buffer = sample.get_buffer()
            events = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), EVENT)
            self._received.append(absolute(buffer.pts, events))
        return np.concatenate(self._received)

    def has_read(self):
        """True if no datagram waits in its socket."""
        with open("/proc/self/net/udp", encoding="ascii") as file:
            sockets = [line.split() for line in file.readlines()[1:]]
        return all(queues.endswith(":00000000") for _, address, _, _, queues, *_ in sockets if address.endswith(":1388"))

    def read_all(self):
        def is_empty():
            self.events()
            return self.has_read()
        wait_until(is_empty, "datagrams stay in the socket")

    def wait_for(self, events):
        """Waits until this many events have arrived or are counted as lost."""
        def are_counted():
            self.events()  # so that a full appsink takes more
            return self.stat("events") + self.stat("lost-events") >= events
        wait_until(are_counted, f"{self.stat('events')} events, {self.stat('lost-events')} lost, of {events}")
        wait_until(lambda: len(self.events()) >= self.stat("events"), "events stay in the depayloader")


def is_part(some, everything):
    """True if the rows stand in `everything` in the same order."""
    rest = iter(everything.tolist())
    return all(row in rest for row in some.tolist())


TO_RECEIVER = f"udpsink name=udp host={Host.address(2)} port=5000 sync=false async=false"
SMALL = f"mtu={576 - IP_AND_UDP}"  # many packets
WITH_SSRC = "application/x-rtp,ssrc=(uint)1234"
FROM_SSRC = FROM_NETWORK.replace("application/x-rtp", WITH_SSRC)
JITTER_BUFFER = f"{FROM_NETWORK} ! rtpjitterbuffer latency=20000 faststart-min-packets=1 ! rtpeventdepay name=counting"


def wait_for_network(network, before=0):
    """Waits until all datagrams have passed the network, and the receiver has read them. `before` were sent by a
    sender that has stopped."""
    source, target = network.hosts[:2]
    wait_until(lambda: network.switch.has_forwarded(before + source.datagrams()), "datagrams stay in the network")
    wait_until(target.has_read, "the receiver does not read")


def send(network, first, end, before=0):
    for part in range(first, end, PART):
        network.hosts[0].send(part, min(part + PART, end))
        wait_for_network(network, before)


def exchange(conditions, loses, *, to=TO_RECEIVER, launch=None, options="", mtu=1500):
    """Sends everything; the first and the last packets arrive."""
    receiver = (Receiver, launch) if launch else (Receiver,)
    with Network((Sender, to, options), receiver, mtu=mtu) as network:
        source, target = network.hosts
        send(network, 0, 1)
        network.switch.conditions = conditions
        send(network, 1, BUFFERS - 1)
        network.switch.conditions = Conditions()
        source.send(BUFFERS - 1, BUFFERS)
        target.wait_for(BUFFERS * EVENTS_PER_BUFFER)
        received, lost = target.events(), target.stat("lost-events")
        assert source.stat("events") == len(sent())
        assert target.stat("events") == len(received)
        assert target.stat("rejected-packets") == 0
        assert len(sent()) - len(received) == lost, f"{len(received)} of {len(sent())} events, {lost} lost"
        assert is_part(received, sent()), "events that were not sent, or in another order"
        assert (lost > 0) == loses, f"{lost} events are lost, of {network.switch.lost} packets"
        assert conditions.loss == 0 or network.switch.lost > 0
        assert conditions.duplication == 0 or network.switch.duplicated > 0
        assert conditions.delayed == 0 or network.switch.delayed > 0
        sizes = [len(frame) - 14 for _, frame in network.switch.frames if frame[12:14] == b"\x08\x00"]
        assert 0.8 * mtu < max(sizes) <= mtu, max(sizes)


def no_loss():
    exchange(Conditions(), False)


def loss_1():
    exchange(Conditions(loss=0.01), True, options=SMALL, mtu=576)


def loss_5():
    exchange(Conditions(loss=0.05), True, options=SMALL, mtu=576)


def loss_20():
    exchange(Conditions(loss=0.2), True, options=SMALL, mtu=576)


def duplication():
    exchange(Conditions(duplication=0.3), False)


def reordering():
    exchange(Conditions(delayed=0.1, delay=0.03), True)


def everything():
    exchange(Conditions(loss=0.05, duplication=0.1, delayed=0.1, delay=0.05), True, options=SMALL, mtu=576)


def jitter():
    exchange(Conditions(delayed=1, delay=0.05), False, launch=JITTER_BUFFER)


def mtu_576():
    exchange(Conditions(), False, options=SMALL, mtu=576)


def mtu_576_fragments():
    """The payloader does not know of the path's MTU: a lost fragment costs its packet."""
    exchange(Conditions(loss=0.05), True, mtu=576)


def mtu_9000():
    exchange(Conditions(), False, options=f"mtu={9000 - IP_AND_UDP} max-latency=200000000", mtu=9000)


def fec():
    exchange(Conditions(loss=0.01), False, options=SMALL, mtu=576,
             to=f"{WITH_SSRC} ! rtpulpfecenc pt=122 percentage=100 multipacket=true ! {TO_RECEIVER}",
             launch=f"{FROM_SSRC} ! rtpstorage name=storage size-time=20000000000"
             " ! rtpjitterbuffer do-lost=true latency=4000 ! rtpulpfecdec name=fec pt=122 ! rtpeventdepay name=counting")


def rtx():
    types = 'payload-type-map="application/x-rtp-pt-map,96=(uint)97"'
    exchange(
        Conditions(loss=0.01), False, options=SMALL, mtu=576,
        to=f"{WITH_SSRC} ! rtprtxsend max-size-packets=1000 {types} ! s.send_rtp_sink"
        f"  rtpsession name=s rtp-profile=avpf  s.send_rtp_src ! {TO_RECEIVER}"
        f"  s.send_rtcp_src ! udpsink host={Host.address(2)} port=5001 sync=false async=false"
        "  udpsrc port=5001 caps=application/x-rtcp ! s.recv_rtcp_sink",
        launch=f"rtpsession name=r rtp-profile=avpf  {FROM_SSRC} ! r.recv_rtp_sink"
        "  udpsrc port=5001 caps=application/x-rtcp ! r.recv_rtcp_sink"
        f"  r.send_rtcp_src ! udpsink host={Host.address(1)} port=5001 sync=false async=false"
        f"  r.recv_rtp_src ! rtprtxreceive {types} ! rtpssrcdemux name=d  d.src_1234"
        " ! rtpjitterbuffer do-retransmission=true latency=4000 ! rtpeventdepay name=counting")


def receivers_come_and_go():
    with Network((Sender, TO_RECEIVER), (Receiver,)) as network:
        target = network.hosts[1]
        target.stop()
        send(network, 0, 50)
        for first in 50, 150:
            target.start()
            before = len(target.events())
            send(network, first, first + 50)
            target.wait_for(50 * EVENTS_PER_BUFFER)
            assert np.array_equal(target.events()[before:], sent(first, first + 50)), f"not those sent from {first}"
            assert target.stat("lost-events") == 0
            target.stop()
            send(network, first + 50, min(first + 100, BUFFERS))


def a_sender_restarts():
    with Network((Sender, TO_RECEIVER), (Receiver,)) as network:
        source, target = network.hosts
        for _ in range(2):
            send(network, 0, 100, before=network.switch.datagrams)
            source.stop()
            source.start()
        target.wait_for(2 * 100 * EVENTS_PER_BUFFER)
        twice = np.concatenate(2 * [sent(0, 100)])
        assert np.array_equal(target.events(), twice)
        assert target.stat("lost-events") == 0


def multicast_to_a_slow_receiver():
    """The slow one loses what does not fit into its socket; the other gets everything."""
    group = FROM_NETWORK + " address=239.1.1.1 multicast-iface=eth0"
    depay = " ! rtpeventdepay name=counting"
    slow_group = group.replace("buffer-size=2000000", "buffer-size=4096")
    with Network((Sender, "udpsink name=udp host=239.1.1.1 port=5000 multicast-iface=eth0 sync=false async=false"),
                 (Receiver, group + depay),
                 (Receiver, slow_group + depay, "max-buffers=1")) as network:
        source, fast, slow = network.hosts
        send(network, 0, 1)
        fast.wait_for(EVENTS_PER_BUFFER)
        slow.wait_for(EVENTS_PER_BUFFER)
        size = slow.resident_size()
        send(network, 1, BUFFERS - 1)  # the slow receiver takes none of its buffers
        fast.wait_for((BUFFERS - 1) * EVENTS_PER_BUFFER)
        assert slow.resident_size() - size < 8 << 20, f"grew by {slow.resident_size() - size} bytes"
        slow.read_all()
        source.send(BUFFERS - 1, BUFFERS)
        fast.wait_for(BUFFERS * EVENTS_PER_BUFFER)
        slow.wait_for(BUFFERS * EVENTS_PER_BUFFER)
        assert np.array_equal(fast.events(), sent())
        assert fast.stat("lost-events") == 0
        received, lost = slow.events(), slow.stat("lost-events")
        assert is_part(received, sent())
        assert 0 < lost == len(sent()) - len(received), f"{len(received)} of {len(sent())} events, {lost} lost"


def exchange_datagrams(options, *, loss=0.0, has_times=True, is_numbered=False):
    """Sends everything in datagrams of other tools; the first and the last ones arrive."""
    depayloader = f"eventdatagramdepay name=counting width=346 height=260 {options}"
    with Network((Sender, TO_RECEIVER, options, "eventdatagrampay"),
                 (Receiver, f"udpsrc port=5000 buffer-size=2000000 ! {depayloader}")) as network:
        source, target = network.hosts
        send(network, 0, 1)
        network.switch.conditions = Conditions(loss=loss)
        send(network, 1, BUFFERS - 1)
        network.switch.conditions = Conditions()
        send(network, BUFFERS - 1, BUFFERS)
        wait_until(lambda: target.stat("packets") == source.stat("packets") - network.switch.lost, "packets miss")
        wait_until(lambda: len(target.events()) >= target.stat("events"), "events stay in the depayloader")
        first = 0 if has_times else 1
        received, everything_sent = target.events()[:, first:], sent()[:, first:]
        assert source.stat("events") == len(everything_sent)
        assert target.stat("events") == len(received)
        assert target.stat("rejected-packets") == target.stat("late-packets") == 0
        assert (network.switch.lost > 0) == (loss > 0)
        assert target.stat("lost-packets") == (network.switch.lost if is_numbered else 0)
        if loss:
            assert 0.5 * len(everything_sent) < len(received) < len(everything_sent)
            assert is_part(received, everything_sent), "events that were not sent, or in another order"
        else:
            assert np.array_equal(received, everything_sent)


def t32():
    exchange_datagrams("format=t32-x16-y15-on1")


def t32_loss():
    exchange_datagrams("format=t32-x16-y15-on1", loss=0.05)


def spif():
    exchange_datagrams("format=spif", has_times=False)


def spif_loss():
    exchange_datagrams("format=spif", loss=0.05, has_times=False)


def jaer():
    exchange_datagrams("format=jaer", is_numbered=True)


def jaer_loss():
    exchange_datagrams("format=jaer", loss=0.05, is_numbered=True)


if __name__ == "__main__":
    hosts.run([no_loss, loss_1, loss_5, loss_20, duplication, reordering, everything, jitter, mtu_576,
               mtu_576_fragments, mtu_9000, fec, rtx, receivers_come_and_go, a_sender_restarts,
               multicast_to_a_slow_receiver, t32, t32_loss, spif, spif_loss, jaer, jaer_loss])
