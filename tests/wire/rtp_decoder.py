#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Decodes our RTP payloads with nothing but docs/rtp-payload-format.md: rtp_decoder.py PROGRAM"""
import struct
import subprocess
import sys


def words_of(body, base):
    """The events of EVT3 words: section 5.1."""
    high = low = wraps = 0
    row = base_column = polarity = None
    for (word,) in struct.iter_unpack("<H", body):
        kind, value = word >> 12, word & 0xFFF
        if kind == 0x0:
            row = value & 0x7FF
        elif kind == 0x2:
            yield base + wraps + high * 4096 + low, value & 0x7FF, row, value >> 11
        elif kind == 0x3:
            base_column, polarity = value & 0x7FF, value >> 11
        elif kind in (0x4, 0x5):
            size = 12 if kind == 0x4 else 8
            for bit in range(size):
                if value >> bit & 1:
                    yield base + wraps + high * 4096 + low, base_column + bit, row, polarity
            base_column += size
        elif kind == 0x6:
            low = value
        elif kind == 0x8:
            if value < high:
                wraps += 1 << 24
            if value != high:
                low = 0
            high = value
        else:
            raise ValueError(f"word {word:#06x}")


def events_of(body, base):
    """The events of format XYTP: section 5.2."""
    for t, x, y_p in struct.iter_unpack("<IHH", body):
        yield base + t, x, y_p & 0x7FFF, y_p >> 15


class Stream:
    def __init__(self, width, height):
        self.width, self.height = width, height
        self.packets = self.count = 0
        self.intervals = []
        self.ended = True
        self.expected = []

    def packet(self, marker, payload):
        first, reserved, count, number, start, duration, base = struct.unpack(
            ">BBHIQQI", payload[:28])
        assert first >> 4 == 1 and reserved == 0
        assert number == self.count
        decode = {0: words_of, 1: events_of}[first & 15]
        events = [(start // 1000 + t, x, y, p) for t, x, y, p in decode(payload[28:], base)]
        assert len(events) == count
        assert all(x < self.width and y < self.height for _, x, y, _ in events)
        if self.ended:
            self.intervals.append((start, duration, []))
        assert self.intervals[-1][:2] == (start, duration)
        self.intervals[-1][2].extend(events)
        self.ended = marker
        self.count += count
        self.packets += 1

    def check(self):
        assert self.ended
        assert self.intervals == self.expected, "other events came back"


def main(program):
    streams = []
    for line in subprocess.run([program], check=True, capture_output=True,
                               text=True).stdout.splitlines():
        kind, *fields = line.split()
        if kind == "stream":
            streams.append(Stream(*map(int, fields)))
        elif kind == "packet":
            streams[-1].packet(fields[0] == "1", bytes.fromhex(fields[1]))
        elif kind == "interval":
            streams[-1].expected.append((*map(int, fields), []))
        else:
            streams[-1].expected[-1][2].append(tuple(map(int, fields)))
    for stream in streams:
        stream.check()
    count = sum(stream.count for stream in streams)
    assert len(streams) == 8 and count > 100_000, (len(streams), count)
    print(f"{count} events of {len(streams)} streams are equal")


main(sys.argv[1])
