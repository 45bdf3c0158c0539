# SPDX-License-Identifier: LGPL-2.1-or-later
"""Reads AEDAT4 files with Python's own libraries of LZ4, Zstandard, FlatBuffers and XML.

    aedat4_check.py FILE...

Prints a line a file: events, ON, sums of t, x and y; frames, and the sum of their pixels; triggers,
and the sum of their sources; IMU samples, and the sum of their numbers; entries of the table. Exits with 77 where a library is missing.
"""
import struct
import sys
import xml.etree.ElementTree

try:
    import flatbuffers
    import flatbuffers.encode
    import flatbuffers.packer
    import flatbuffers.table
    import lz4.frame
    import zstandard
except ImportError as missing:
    print(missing)
    sys.exit(77)

FLAGS = flatbuffers.number_types


def root(content, identifier):
    assert struct.unpack_from("<I", content)[0] == len(content) - 4
    assert content[8:12] == identifier, content[8:12]
    start = 4 + flatbuffers.encode.Get(flatbuffers.packer.uoffset, content, 4)
    return flatbuffers.table.Table(content, start)


def field(table, number):
    return table.Offset(4 + 2 * number)


def scalar(table, number, flags):
    offset = field(table, number)
    return table.Get(flags, offset + table.Pos) if offset else 0


def decompressed(compression, data):
    if compression == 0:
        return data
    if compression in (1, 2):
        return lz4.frame.decompress(data)
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=1 << 26)


def check(path):
    with open(path, "rb") as file:
        data = file.read()
    assert data[:14] == b"#!AER-DAT4.0\r\n"
    (size,) = struct.unpack_from("<I", data, 14)
    header = root(data[14 : 18 + size], b"IOHE")
    compression = scalar(header, 0, FLAGS.Int32Flags)
    table_at = scalar(header, 1, FLAGS.Int64Flags)
    info = xml.etree.ElementTree.fromstring(header.String(header.Pos + field(header, 2)))
    kinds = {}
    for stream in info.find("node[@name='outInfo']"):
        assert stream.get("path").endswith("/outInfo/%s/" % stream.get("name"))
        kinds[int(stream.get("name"))] = stream.find("attr[@key='typeIdentifier']").text
        assert int(stream.find("node[@name='info']/attr[@key='sizeX']").text) > 0

    events = on = sum_t = sum_x = sum_y = frames = pixels = entries = 0
    triggers = sources = samples = numbers = 0
    at = 18 + size
    end = table_at if table_at > 0 else len(data)
    while at < end:
        stream, size = struct.unpack_from("<ii", data, at)
        content = decompressed(compression, data[at + 8 : at + 8 + size])
        kind = kinds[stream]
        packet = root(content, kind.encode())
        if kind == "EVTS":
            start, count = packet.Vector(field(packet, 0)), packet.VectorLen(field(packet, 0))
            for t, x, y, polarity in struct.iter_unpack("<qhh?3x", content[start : start + 16 * count]):
                events += 1
                on += polarity
                sum_t += t
                sum_x += x
                sum_y += y
        elif kind in ("TRIG", "IMUS"):
            vector = field(packet, 0)
            for i in range(packet.VectorLen(vector)):
                at_element = packet.Indirect(packet.Vector(vector) + 4 * i)
                element = flatbuffers.table.Table(content, at_element)
                sum_t += scalar(element, 0, FLAGS.Int64Flags)
                if kind == "TRIG":
                    triggers += 1
                    sources += scalar(element, 1, FLAGS.Int8Flags)
                else:
                    samples += 1
                    numbers += sum(int(scalar(element, k, FLAGS.Float32Flags)) for k in range(1, 11))
        else:
            assert kind == "FRME"
            frames += 1
            start, count = packet.Vector(field(packet, 10)), packet.VectorLen(field(packet, 10))
            pixels += sum(content[start : start + count])
        at += 8 + size
    assert at == end
    if table_at > 0:
        table = root(decompressed(compression, data[end:]), b"FTAB")
        entries = table.VectorLen(field(table, 0))
    print(events, on, sum_t, sum_x, sum_y, frames, pixels, triggers, sources, samples, numbers, entries)


for name in sys.argv[1:]:
    check(name)
