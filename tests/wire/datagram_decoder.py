#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Decodes our datagrams as the tools that receive them do: datagram_decoder.py PROGRAM"""
import struct
import subprocess
import sys


def spif(packet, order):
    words = [word for (word,) in struct.iter_unpack(order + "I", packet)]
    while words:
        word = words.pop(0)
        t = None if word >> 31 else words.pop(0)
        yield t, word >> 16 & 0x7FFF, word & 0x7FFF, word >> 15 & 1


def event_stream(packet, height):
    (t,) = struct.unpack_from("<Q", packet)
    at = 8
    while at < len(packet):
        byte = packet[at]
        at += 1
        if byte == 0xFF:
            t += 127
        elif byte != 0xFE:
            t += byte >> 1
            x, y = struct.unpack_from("<HH", packet, at)
            at += 4
            yield t, x, height - 1 - y, byte & 1


def jaer(packet, width, height):
    for address, t in struct.iter_unpack(">Ii", packet):
        if (width, height) == (128, 128):
            x, y, p = address >> 1 & 0x7F, address >> 8 & 0x7F, 1 - (address & 1)
        else:
            assert not address >> 31 and not address >> 10 & 1  # neither a sample nor special
            x, y, p = address >> 12 & 0x3FF, address >> 22 & 0x1FF, address >> 11 & 1
        yield t & 0xFFFFFFFF, width - 1 - x, height - 1 - y, p


class Stream:
    def __init__(self, name, width, height):
        self.name, self.width, self.height = name, int(width), int(height)
        self.number = 0
        self.decoded = []
        self.expected = []

    def packet(self, packet):
        events = list(self.events_of(packet))
        if self.name.startswith("t"):
            assert len(events) <= 100
        assert events and len(packet) <= 1400
        self.decoded += events

    def events_of(self, packet):
        if self.name.startswith("spif"):
            assert len(packet) <= (1024 if "timestamps" in self.name else 512)
            return spif(packet, ">" if self.name.endswith("big-endian") else "<")
        if self.name == "t64-x16-y16-on8":
            return struct.iter_unpack("<QHHB", packet)
        if self.name == "t32-x16-y15-on1":
            return ((t, x, y >> 1, y & 1) for t, x, y in struct.iter_unpack("<IHH", packet))
        if self.name == "es":
            return event_stream(packet, self.height)
        if self.name == "jaer":
            self.number += 1
            assert struct.unpack_from(">i", packet) == (self.number,)
            packet = packet[4:]
        return jaer(packet, self.width, self.height)

    def check(self):
        assert len(self.expected) == 5000
        if self.name in ("spif", "spif-big-endian"):
            self.expected = [(None, *pixel) for t, *pixel in self.expected]
        elif self.name not in ("t64-x16-y16-on8", "es"):
            self.expected = [(t & 0xFFFFFFFF, *pixel) for t, *pixel in self.expected]
        assert [tuple(event) for event in self.decoded] == self.expected, self.name


streams = []
printed = subprocess.run(sys.argv[1], check=True, capture_output=True, text=True).stdout
for line in printed.splitlines():
    kind, *fields = line.split()
    if kind == "stream":
        streams.append(Stream(*fields))
    elif kind == "packet":
        streams[-1].packet(bytes.fromhex(fields[0]))
    else:
        streams[-1].expected.append(tuple(map(int, fields)))
for stream in streams:
    stream.check()
assert len(streams) == 27
