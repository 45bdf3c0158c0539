#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""rtsp-events as its clients see it."""
import itertools
import os
import socket
import ssl
import subprocess
import tempfile
import time
import warnings
from urllib.parse import urlsplit

import scratch  # noqa: F401  first
import numpy as np
from gi.repository import Gio
from gst_eventcamera.pipeline import Gst, Pipeline, PipelineError, events_of

from servers import SECONDS, ServerProcess

PROGRAM = os.path.join(os.environ["SOURCE"], "pipelines", "rtsp_events.py")


class Server(ServerProcess):
    def __init__(self, *arguments):
        super().__init__(PROGRAM, "--address", "127.0.0.1", "--port", "0", *arguments)
        self.base = self.address.split()[1].removesuffix("/events,")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.interrupt()


class Client(Pipeline):
    """Plays a URL into appsinks."""

    def __init__(self, url, rest, **properties):
        super().__init__(f"rtspsrc name=source latency=200 {rest}")
        for name, value in {"location": url, **properties}.items():
            self.element("source").set_property(name.replace("_", "-"), value)

    def __enter__(self):
        super().__enter__()
        self.set_state(Gst.State.PLAYING)
        return self

    def pause(self):
        self._pipeline.set_state(Gst.State.PAUSED)  # does not wait, since nothing arrives

    def first(self, count, sink="out"):
        return list(itertools.islice(self.samples(sink), count))


def client_of(url, **properties):
    return Client(url + "/events", "! rtpeventdepay ! appsink name=out sync=false", **properties)


def video_of(url, **properties):
    return Client(url + "/video", "! rtpvp8depay ! vp8dec ! videoconvert ! video/x-raw,format=GRAY8"
                  " ! appsink name=out sync=false", **properties)


def check_events(samples):
    caps = samples[0].get_caps().get_structure(0)
    assert caps.get_value("width") == 320 and caps.get_value("height") == 240, caps.to_string()
    events = sum(map(len, map(events_of, samples)))
    assert events > 100 * len(samples), f"only {events} events in {len(samples)} buffers"


def check_video(samples):
    pictures = {sample.get_buffer().extract_dup(0, 320 * 240) for sample in samples}
    assert len(pictures) > len(samples) / 2, f"only {len(pictures)} different frames of {len(samples)}"
    assert all(min(picture) < 50 and max(picture) > 200 for picture in pictures), "no white ball on black"


def refused(words, client):
    try:
        with client:
            client.first(1)
    except PipelineError as cause:
        assert words in str(cause), f"refused with: {cause}"
    else:
        raise AssertionError("not refused")


def fails(words, *arguments):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=SECONDS, check=False)
    assert result.returncode in (1, 2), f"{arguments}: exit status {result.returncode}"
    assert words in result.stderr and "Traceback" not in result.stderr, result.stderr


def bytes_by_time(samples):
    return {sample.get_buffer().pts: sample.get_buffer().extract_dup(0, sample.get_buffer().get_size())
            for sample in samples}


def clients_come_and_leave():
    with Server() as server:
        with client_of(server.base) as first, video_of(server.base) as watching:
            check_events(first.first(5))
            check_video(watching.first(5))
        time.sleep(5)
        idle = server.descriptors()  # with those that the first clients left open for the next
        with client_of(server.base) as first:
            check_events(first.first(20))
            with client_of(server.base, protocols=4) as second, video_of(server.base) as watching:
                check_video(watching.first(20))
                ours, theirs = bytes_by_time(first.first(60)), bytes_by_time(second.first(60))
                both = ours.keys() & theirs.keys()
                assert len(both) > 20, f"only {len(both)} intervals in common"
                assert all(ours[pts] == theirs[pts] for pts in both), "two clients get different events"
            check_events(first.first(20))
        deadline = time.monotonic() + SECONDS
        while server.descriptors() > idle:
            assert time.monotonic() < deadline, f"{server.descriptors()} descriptors, {idle} before the clients"
            time.sleep(0.5)
        fails("choose another with --port", "--address", "127.0.0.1", "--port", server.base.split(":")[-1])


def pauses():
    """While a client pauses, frames are dropped, not kept: 3.5 MB a second."""
    with Server() as server, client_of(server.base) as client:
        client.first(5)
        client.pause()
        time.sleep(1)
        before = server.memory()
        time.sleep(4)
        growth = server.memory() - before
        assert growth < 7, f"{growth:.0f} MB more in 4 s"


def passwords():
    with Server("--user", "ada", "--password", "secret") as server:
        refused("Unauthorized", client_of(server.base))
        refused("Unauthorized", video_of(server.base, user_id="ada", user_pw="wrong"))
        with client_of(server.base, user_id="ada", user_pw="secret") as client:
            check_events(client.first(5))


def takes_tls(base, version):
    """Whether a server takes a version of TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_ciphers("ALL:@SECLEVEL=0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        context.minimum_version = context.maximum_version = version
    try:
        with socket.create_connection((urlsplit(base).hostname, urlsplit(base).port), 30) as connection:
            with context.wrap_socket(connection):
                return True
    except (ssl.SSLError, ConnectionError):
        return False


def encryption():
    with tempfile.TemporaryDirectory() as folder:
        certificate, pair = os.path.join(folder, "certificate.pem"), os.path.join(folder, "pair.pem")
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=127.0.0.1",
                        "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", pair, "-out", certificate],
                       check=True, capture_output=True)
        with open(certificate, "rb") as public, open(pair, "ab") as both:
            both.write(public.read())
        fails(f"{certificate} has no private key; append it", "--certificate", certificate, "--port", "0")
        trusted = Gio.TlsFileDatabase.new(certificate)
        with Server("--certificate", pair, "--user", "ada", "--password", "secret") as server:
            assert server.base.startswith("rtsps://"), server.base
            taken = [version.name for version in ssl.TLSVersion if version > ssl.TLSVersion.SSLv3
                     and takes_tls(server.base, version)]
            assert taken == ["TLSv1_2", "TLSv1_3"], f"versions of TLS: {taken}"
            refused("Failed to connect", client_of(server.base, user_id="ada", user_pw="secret"))
            refused("Unauthorized", client_of(server.base, tls_database=trusted))
            with client_of(server.base, tls_database=trusted, user_id="ada", user_pw="secret") as client:
                check_events(client.first(5))
        with Server("--certificate", pair) as server:
            refused("Could not receive message", client_of(server.base.replace("rtsps", "rtsp")))
            with video_of(server.base, tls_database=trusted) as client:
                check_video(client.first(5))


def running_time(sample):
    """In seconds."""
    return sample.get_segment().to_running_time(Gst.Format.TIME, sample.get_buffer().pts) / 1e9


def ball_in_video(sample):
    """(time, x, y)"""
    pixels = np.frombuffer(sample.get_buffer().extract_dup(0, 320 * 240), np.uint8).reshape(240, 320)
    y, x = np.nonzero(pixels > 128)
    return running_time(sample), x.mean(), y.mean()


def ball_in_events(sample):
    events = events_of(sample)
    assert len(events) > 50, f"only {len(events)} events until {events.end} s"
    return running_time(sample) + events["t"].mean() / 1e6 - events.start, events["x"].mean(), events["y"].mean()


def since_times_went_back(samples):
    """As they do when RTCP synchronizes them."""
    samples = np.array(samples)
    back = np.flatnonzero(np.diff(samples[:, 0]) < 0)
    return samples[back[-1] + 1:] if len(back) else samples


def offset_between(video, events):
    """How much later than the video the last events show the ball, and how far the two positions then
    are apart, in pixels (RMS)."""
    # Only between frames that follow one another.
    after = np.searchsorted(video[:, 0], events[:, 0])
    inside = (after > 5) & (after < len(video) - 5)
    inside[inside] &= video[after[inside], 0] - video[after[inside] - 1, 0] < 0.1
    events = events[inside][-60:]
    if len(events) < 30:
        return 0, np.inf

    def distance(lag):
        return np.sqrt(np.mean(sum((np.interp(events[:, 0] - lag, video[:, 0], video[:, axis]) - events[:, axis])**2
                                   for axis in (1, 2))))

    lag = min(np.arange(-0.15, 0.15, 0.001), key=distance)
    return lag, distance(lag)


def in_sync():
    """The events of eventsim-dvs are where the ball is in the video at the same time."""
    with (Server("--simulator", "eventsim-dvs") as server, Client(
            server.base + "/both",
            "source. ! rtpvp8depay ! vp8dec ! videoconvert"
            " ! video/x-raw,format=GRAY8 ! appsink name=video sync=false"
            "  source. ! rtpeventdepay ! appsink name=events sync=false",
            buffer_mode=4) as client):  # synced: server and client have one clock
        video, events = [], []
        lag, distance = 0, np.inf
        deadline = time.monotonic() + SECONDS
        while abs(lag) > 0.01 or distance > 1:  # until RTCP has synchronized them
            assert time.monotonic() < deadline, f"events are {1000 * lag:.0f} ms late, {distance:.1f} pixels apart"
            video += map(ball_in_video, client.first(30, "video"))
            while not events or events[-1][0] < video[-1][0]:
                events += map(ball_in_events, client.first(1, "events"))
            lag, distance = offset_between(since_times_went_back(video), since_times_went_back(events))
        print(f"events are {1000 * lag:.0f} ms later than the video, {distance:.2f} pixels apart")


def pictures():
    """The events of the test scene, and of a recording that is repeated, as video for any player."""
    with tempfile.TemporaryDirectory() as folder:
        recording = os.path.join(folder, "ball.raw")
        subprocess.run([os.environ["GST_LAUNCH"], "-q", "videotestsrc", "pattern=ball", "num-buffers=30", "!",
                        "eventsim-diff", "!", "evtenc", "!", "filesink", f"location={recording}"], check=True)
        for arguments in ((), ("--source", recording)):
            with Server(*arguments) as server:
                assert ("/video" in server.address) == (not arguments), server.address
                with Client(server.base + "/picture", "! rtph264depay ! avdec_h264 ! videoconvert"
                            " ! video/x-raw,format=RGB ! appsink name=out sync=false") as client:
                    for sample in client.first(75)[15:]:  # longer than the recording
                        pixels = np.frombuffer(sample.get_buffer().extract_dup(0, 320 * 240 * 3), np.uint8)
                        drawn = np.count_nonzero(pixels.reshape(-1, 3).max(1) > 150)
                        times = sample.get_buffer().pts
                        assert 50 < drawn < 10000, f"{drawn} pixels of events at {times} ns"
                with client_of(server.base) as client:
                    check_events(client.first(20))


def errors():
    fails("nowhere is no file", "--source", "nowhere", "--port", "0")
    fails("--password", "--user", "ada")
    fails("no element \"nosuch\"", "--simulator", "nosuch", "--port", "0")


for test in (clients_come_and_leave, pictures, in_sync, pauses, passwords, encryption, errors):
    start = time.monotonic()
    test()
    print(f"{test.__name__}: {time.monotonic() - start:.1f} s", flush=True)
