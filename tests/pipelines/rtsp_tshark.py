#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""tshark follows a client of rtsp-events from the session description to the packets, without complaint."""
import contextlib
import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile

import scratch  # noqa: F401  first
from gst_eventcamera.pipeline import Pipeline

from servers import ServerProcess

PROGRAM = os.path.join(os.environ["SOURCE"], "pipelines", "rtsp_events.py")
BUFFERS = 100
SKIPPED = 77  # exit status that Meson knows
# tshark's severity, and its group of what TCP repeats when it waits too long for a busy machine.
WARNING, TCP_SEQUENCE = 0x600000, 0x2000000


def enter_namespace():
    """Starts the program again as root of a network of its own, or ends it as skipped."""
    if "IN_NAMESPACE" in os.environ:
        return
    unshare = [shutil.which("unshare") or "unshare", "--map-root-user", "--net"]
    try:
        subprocess.run([*unshare, "ip", "link", "set", "lo", "up"], check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError) as cause:
        print(f"Skipped: cannot make network namespaces: {cause} {getattr(cause, 'stderr', '')}")
        sys.exit(SKIPPED)
    os.execve(unshare[0], [*unshare, "sh", "-c", 'ip link set lo up && exec "$@"', "sh", sys.executable, *sys.argv],
              {**os.environ, "IN_NAMESPACE": "1"})


@contextlib.contextmanager
def captured(path):
    """Writes the packets of the loopback device to a file."""
    capture = subprocess.Popen(["tshark", "-i", "lo", "-w", path], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    for line in capture.stderr:
        if "Capture started" in line:
            break
    try:
        yield
    finally:
        capture.send_signal(signal.SIGINT)
        capture.communicate()


def play(buffers):
    with Pipeline("rtspsrc location=rtsp://127.0.0.1:8554/both protocols=udp nat-method=none name=source"
                  "  source. ! rtpvp8depay ! fakesink"
                  "  source. ! rtpeventdepay ! appsink name=out sync=false") as pipeline:
        assert sum(1 for _ in itertools.islice(pipeline.samples(), buffers)) == buffers


def dissected(path, which, *fields):
    """Lines of fields of the frames that match."""
    output = subprocess.run(
        ["tshark", "-r", path, "-Y", which, "-T", "fields", *(part for field in fields for part in ("-e", field))],
        check=True, capture_output=True, text=True).stdout
    return [line.split("\t") for line in output.splitlines()]


def rtsp_session():
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "session.pcap")
        server = ServerProcess(PROGRAM, "--address", "127.0.0.1")
        try:
            with captured(path):
                play(BUFFERS)
        finally:
            server.interrupt()

        for number, protocol, severities, groups, messages in dissected(
                path, "_ws.expert", "frame.number", "_ws.col.Protocol", "_ws.expert.severity", "_ws.expert.group",
                "_ws.expert.message"):
            assert not any(int(severity) >= WARNING and int(group) != TCP_SEQUENCE for severity, group in
                           zip(severities.split(","), groups.split(","))), f"frame {number}, {protocol}: {messages}"
        descriptions = dissected(path, "sdp", "sdp.mime.type", "sdp.sample_rate", "sdp.fmtp.parameter")
        assert descriptions, "tshark sees no session description"
        types, rates, parameters = (set(field.split(",")) for field in descriptions[0])
        assert types == {"VP8", "X-EVENT-CAMERA"} and rates == {"90000", "1000000"}, descriptions
        assert parameters >= {"width=320", "height=240", "format=EVT3"}, descriptions

        # Known as RTP from the session only.
        packets = dissected(path, "rtp && rtp.setup-method == RTSP", "rtp.ssrc", "rtp.p_type", "rtp.seq",
                            "rtp.timestamp", "rtp.marker")
        assert len(packets) > BUFFERS and len({ssrc for ssrc, *_ in packets}) == 2, packets[:10]
        for ssrc in {ssrc for ssrc, *_ in packets}:
            stream = [packet for packet in packets if packet[0] == ssrc]
            assert len({packet_type for _, packet_type, *_ in stream}) == 1, stream[0]
            numbers = [int(number) for _, _, number, *_ in stream]
            assert all((a + 1) % 65536 == b for a, b in zip(numbers, numbers[1:])), "sequence numbers"
            # A timestamp has one marker, in its last packet; the capture may begin and end anywhere.
            wrong = [(a, b) for a, b in zip(stream, stream[1:]) if (a[4] == "1") != (a[3] != b[3])]
            assert not wrong, f"markers of {wrong}"
        reports = {packet_type for line in dissected(path, "rtcp", "rtcp.pt") for packet_type in line[0].split(",")}
        assert {"200", "201", "202"} <= reports, f"RTCP packets of types {reports}"
        print(f"{len(packets)} packets")


enter_namespace()
rtsp_session()
