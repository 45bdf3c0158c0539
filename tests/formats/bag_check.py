#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks MCAP files of this project against the specifications, without its code:
  bag_check.py FILE EVENTS
All records, checksums and the index must be right, and the events those of the file EVENTS (int64 t, uint16 x, y, p)."""
import struct
import sys
import zlib

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"


class Fields:
    def __init__(self, content):
        self.content, self.at = content, 0

    def take(self, code):
        size = struct.calcsize("<" + code)
        values = struct.unpack_from("<" + code, self.content, self.at)
        self.at += size
        return values if len(values) > 1 else values[0]

    def bytes(self, code="I"):
        size = self.take(code)
        self.at += size
        assert self.at <= len(self.content), "a field is cut"
        return self.content[self.at - size:self.at]

    def align(self, size):
        self.at += -self.at % size


def records(content, start=0):
    """(opcode, content, offset) of each."""
    at = start
    while at < len(content):
        opcode, size = struct.unpack_from("<BQ", content, at)
        assert at + 9 + size <= len(content), "a record is cut"
        yield opcode, content[at + 9:at + 9 + size], at
        at += 9 + size


def evt3(words, stamp):
    """Events of one packet, which must not depend on those before it."""
    high = low = y = None
    base = pol = 0
    for (word,) in struct.iter_unpack("<H", words):
        kind, value = word >> 12, word & 0xFFF
        if kind == 8:
            assert high is None or (value - high) % 4096 <= 1, "a TIME_HIGH is left out"
            high, low = value, None
        elif kind == 6:
            low = value
        elif kind == 0:
            y = value
        elif kind in (2, 3, 4, 5):
            clock = high << 12 | low
            t = stamp + (clock - stamp) % 2**24
            if kind == 2:
                yield t, value & 0x7FF, y, value >> 11
            elif kind == 3:
                base, pol = value & 0x7FF, value >> 11
            else:
                for bit in range(12 if kind == 4 else 8):
                    if value >> bit & 1:
                        yield t, base + bit, y, pol
                base += 12 if kind == 4 else 8
        else:
            raise AssertionError(f"word {word:04x}")


def events_of(message, log_time):
    assert message[:4] == b"\0\1\0\0", "this is not little-endian CDR"
    fields = Fields(message[4:])
    seconds, nanoseconds = fields.take("II")
    stamp = seconds * 10**9 + nanoseconds
    assert stamp == log_time, "the stamp is not the time of the message"
    assert fields.bytes().endswith(b"\0"), "a text has no zero"
    fields.align(4)
    height, width = fields.take("II")
    fields.align(8)
    _, time_base = fields.take("QQ")
    encoding = fields.bytes()
    assert fields.take("B") == 0
    fields.align(4)
    events = fields.bytes()
    assert fields.at == len(fields.content), "there are bytes after the message"
    if encoding == b"evt3\0":
        found = list(evt3(events, stamp // 1000))
    else:
        assert encoding == b"mono\0" and time_base == stamp
        found = [((time_base + (word & 0xFFFFFFFF)) // 1000, word >> 32 & 0xFFFF, word >> 48 & 0x7FFF, word >> 63)
                 for (word,) in struct.iter_unpack("<Q", events)]
    assert found[0][0] == stamp // 1000, "the stamp is not the time of the first event"
    assert all(x < width and y < height for _, x, y, _ in found)
    return found


def main():
    with open(sys.argv[1], "rb") as file:
        content = file.read()
    assert content.startswith(MAGIC) and content.endswith(MAGIC)
    body = content[:-len(MAGIC)]
    channels, events, chunks, indexes, offsets, messages = {}, [], {}, {}, {}, 0
    for opcode, record, at in records(body, len(MAGIC)):
        fields = Fields(record)
        offsets.setdefault(opcode, []).append(at)
        if opcode == 1:
            assert fields.bytes() == b"ros2"
        elif opcode == 4:
            channel, _ = fields.take("HH")
            channels[channel] = fields.bytes()
            assert fields.bytes() == b"cdr"
        elif opcode == 6:
            first, last, size, checksum = fields.take("QQQI")
            compression = fields.bytes()
            stored = fields.bytes("Q")
            decompress = {b"": bytes, b"lz4": lz4.frame.decompress, b"zstd": zstandard.decompress}[compression]
            inner = decompress(stored)
            assert len(inner) == size and zlib.crc32(inner) == checksum
            times = []
            for kind, message, offset in records(inner):
                assert kind == 5
                channel, sequence, log_time, _ = struct.unpack_from("<HIQQ", message)
                assert channels[channel] == b"/event_camera/events" and sequence == messages
                messages += 1
                times.append((log_time, offset))
                events += events_of(message[22:], log_time)
            assert (first, last) == (times[0][0], times[-1][0])
            chunks[at] = first, last, len(record) + 9, times
        elif opcode == 7:
            channel, entries = fields.take("H"), fields.bytes()
            assert list(struct.iter_unpack("<QQ", entries)) == chunks[max(chunks)][3], "the index of messages is wrong"
            indexes[max(chunks)] = at, len(record) + 9
        elif opcode == 8:
            first, last, position, size = fields.take("QQQQ")
            assert chunks[position][:3] == (first, last, size), "the index of chunks is wrong"
            (entry,) = struct.iter_unpack("<HQ", fields.bytes())
            assert (entry[1], fields.take("Q")) == indexes[position]
        elif opcode == 0x0B:
            counts = fields.take("QHIIIIQQ")
            assert (counts[0], counts[5]) == (messages, len(chunks)), "the statistics are wrong"
        elif opcode == 0x0E:
            group, start, size = fields.take("BQQ")
            assert start in offsets[group]
            assert all(kind == group for kind, _, _ in records(body[start:start + size]))
        elif opcode == 2:
            start, _, checksum = fields.take("QQI")
            assert checksum == zlib.crc32(body[start:-4]), "the checksum of the summary is wrong"
    assert len(offsets[8]) == len(chunks) and len(offsets[0x0F]) == 1
    with open(sys.argv[2], "rb") as file:
        assert events == list(struct.iter_unpack("<qHHH", file.read())), "the events are others"


main()
