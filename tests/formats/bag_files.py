#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes ROS bags from the specifications of their formats, without this project's code:
  bag_files.py DIRECTORY [many]
    The events are in events.lines (t x y p), the frames in frames.lines (t and the value of all pixels).
    many.db3 has a message 200,000 times.
  bag_files.py DIRECTORY given EVENTS
    Writes ros1.bag and ros2.db3 with the events of lines "t x y p".

mcap.dev/spec; wiki.ros.org/Bags/Format/2.0; github.com/ros2/rosbag2 (rosbag2_storage_sqlite3)."""
import bz2
import sqlite3
import struct
import sys
import zlib
from pathlib import Path

import lz4.frame
import zstandard

WIDTH, HEIGHT = 346, 260
IMAGE_WIDTH, IMAGE_HEIGHT = 86, 65
START = 1_700_000_000_123_456  # microseconds since 1970
SENSOR_START = 77_777_777  # clock of the sensor at START
DRIFT = 20_000  # microseconds in which the clock of the sensor falls behind by one
DELAY = 3_000  # microseconds until a message is recorded
PER_PACKET = 97
EVENT_TYPES = {"packet": "event_camera_msgs/EventPacket", "old": "event_array_msgs/EventArray", "array": "dvs_msgs/EventArray",
               "prophesee": "prophesee_event_msgs/EventArray"}
IMAGE_TYPE = "sensor_msgs/Image"


def made_events():
    state, t, events = 1, START, []
    for _ in range(6000):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        t += (state >> 33) % 8000
        events.append((t, (state >> 20) % WIDTH, (state >> 40) % HEIGHT, (state >> 50) & 1))
    return events


EVENTS = made_events()
FRAMES = [(START + i * 500_000, i + 1) for i in range(40)]


class Ros1:
    """Fields without padding, little-endian."""

    def __init__(self):
        self.bytes = b""

    def put(self, code, *values):
        for value in values:
            self.bytes += struct.pack("<" + code, value)

    def text(self, text):
        self.array(text.encode())

    def array(self, content):
        self.put("I", len(content))
        self.bytes += content

    def header(self, t):
        self.put("I", 0, t // 1_000_000, t % 1_000_000 * 1000)
        self.text("camera")

    def message(self):
        return self.bytes


class Cdr(Ros1):
    """XCDR1: fields at multiples of their size after the encapsulation."""

    def put(self, code, *values):
        for value in values:
            self.bytes += bytes(-len(self.bytes) % struct.calcsize("<" + code))
            super().put(code, value)

    def text(self, text):
        self.array(text.encode() + b"\0")

    def header(self, t):
        self.put("I", t // 1_000_000, t % 1_000_000 * 1000)
        self.text("camera")

    def message(self):
        return b"\0\1\0\0" + self.bytes


class Evt3:
    """Words of a camera that states only what changes, through all packets."""

    def __init__(self):
        self.high = self.low = self.y = None

    def words(self, events):
        words = []
        for t, x, y, p in events:
            t = t - START + SENSOR_START
            while self.high != t >> 12:
                self.high = t >> 12 if self.high is None else self.high + 1
                words.append(0x8000 | self.high & 0xFFF)
                self.low = None
            if self.low != t & 0xFFF:
                self.low = t & 0xFFF
                words.append(0x6000 | self.low)
            if self.y != y:
                self.y = y
                words.append(y)
            words.append(0x2000 | p << 11 | x)
        return struct.pack(f"<{len(words)}H", *words)


def libcaer_cmp_words(base, events):
    """Words of 16 bits, some of them vectors."""
    words = []
    for number, (t, x, y, p) in enumerate(events):
        words += [t - base >> 12 & 0xFFF, 0x1000 | t - base & 0xFFF, 0x2000 | x]
        words += [0x4000 | p << 11 | y - 3, 0x5008] if number % 2 and y >= 3 else [0x3000 | p << 11 | y]
    return struct.pack(f"<{len(words)}H", *words)


def packet_of(fields, events, number, encoding, evt3, restart):
    t = events[0][0]
    fields.header(t if restart else t + (t - START) // DRIFT)
    fields.put("I", HEIGHT, WIDTH)
    sensor_time = t - restart if restart and t >= restart else t - START + SENSOR_START
    fields.put("Q", number, (t if encoding.startswith("libcaer") else sensor_time) * 1000)
    fields.text(encoding)
    fields.put("B", 0)
    if encoding == "evt3":
        fields.array(evt3.words(events))
    elif encoding == "libcaer":
        fields.array(b"".join(struct.pack("<II", x << 17 | y << 2 | p << 1 | 1, at - t) for at, x, y, p in events))
    elif encoding == "libcaer_cmp":
        fields.array(libcaer_cmp_words(t, events))
    else:
        fields.array(b"".join(struct.pack("<Q", p << 63 | y << 48 | x << 32 | (at - t) * 1000 + at % 7)
                              for at, x, y, p in events))


def array_of(fields, events):
    fields.header(events[0][0])
    fields.put("I", HEIGHT, WIDTH, len(events))
    for t, x, y, p in events:
        fields.put("H", x, y)
        fields.put("I", t // 1_000_000, t % 1_000_000 * 1000 + 999)
        fields.put("B", p)


def image_of(fields, t, value, encoding):
    fields.header(t)
    fields.put("I", IMAGE_HEIGHT, IMAGE_WIDTH)
    fields.text(encoding)
    fields.put("B", 0)
    pixel = bytes([value]) if encoding == "mono8" else bytes([value, 0, 99])
    fields.put("I", IMAGE_WIDTH * len(pixel) + 2)
    fields.array((pixel * IMAGE_WIDTH + b"\0\0") * IMAGE_HEIGHT)


def messages(serialization, kind, encoding="evt3", image="mono8", restart=0):
    """[(topic, time of recording in microseconds, bytes)], by that time. restart: the packet with which the
    camera, which does not drift then, counts from 0 again; 0: none."""
    evt3, all_messages = Evt3(), []
    for number, first in enumerate(range(0, len(EVENTS), PER_PACKET)):
        events, fields = EVENTS[first:first + PER_PACKET], serialization()
        if kind == "packet":
            count = number - restart if restart and number >= restart else 1000 + number
            packet_of(fields, events, count, encoding, evt3, restart and EVENTS[restart * PER_PACKET][0])
        else:
            array_of(fields, events)
        all_messages.append(("/camera/events", events[0][0] + DELAY, fields.message()))
    for t, value in FRAMES:
        fields = serialization()
        image_of(fields, t, value, image)
        all_messages.append(("/camera/image", t + DELAY, fields.message()))
        all_messages.append(("/rosout", t + DELAY, b"\0\1\0\0other"))
        if t == START:
            continue
        fields = serialization()
        array_of(fields, EVENTS[:1])
        all_messages.append(("/second/events", t + DELAY, fields.message()))
    return sorted(all_messages, key=lambda message: message[1])


def topics_of(kind):
    return {"/rosout": "rcl_interfaces/Log", "/camera/events": EVENT_TYPES[kind], "/camera/image": IMAGE_TYPE,
            "/second/events": EVENT_TYPES["array"]}


def sized(text):
    return struct.pack("<I", len(text)) + (text.encode() if isinstance(text, str) else text)


# MCAP

def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


COMPRESS = {"": bytes, "lz4": lz4.frame.compress, "zstd": lambda content: zstandard.compress(content)}


def write_mcap(path, all_messages, topics, compression="", chunked=True, summary=True, ros1=False):
    """Writes two channels for each topic's type: the schemas are within the chunks, as they come."""
    magic = b"\x89MCAP0\r\n"
    out = magic + record(1, sized("ros1" if ros1 else "ros2") + sized("test"))
    heads = {}
    for number, (name, kind) in enumerate(topics.items()):
        kind = kind if ros1 else kind.replace("/", "/msg/")
        schema = record(3, struct.pack("<H", number + 1) + sized(kind) + sized("ros1msg" if ros1 else "ros2msg") + sized(""))
        metadata = sized(sized("offered_qos_profiles") + sized(""))
        heads[name] = number + 10, schema, record(4, struct.pack("<HH", number + 10, number + 1) + sized(name)
                                                  + sized("ros1" if ros1 else "cdr") + metadata)
    known, chunk, index, chunk_indexes, counts = set(), b"", {}, b"", {}
    first, last = 2**63, 0

    def end_chunk():
        nonlocal out, chunk, index, chunk_indexes
        if not chunk:
            return
        stored, at = COMPRESS[compression](chunk), len(out)
        times = [time for entries in index.values() for time, _ in entries]
        out += record(6, struct.pack("<QQQI", min(times), max(times), len(chunk), zlib.crc32(chunk))
                      + sized(compression) + struct.pack("<Q", len(stored)) + stored)
        size, offsets = len(out) - at, b""
        for channel, entries in index.items():
            offsets += struct.pack("<HQ", channel, len(out))
            out += record(7, struct.pack("<H", channel)
                          + sized(b"".join(struct.pack("<QQ", *entry) for entry in entries)))
        chunk_indexes += record(8, struct.pack("<QQQQ", min(times), max(times), at, size) + sized(offsets)
                                + struct.pack("<Q", len(out) - at - size) + sized(compression)
                                + struct.pack("<QQ", len(stored), len(chunk)))
        chunk, index = b"", {}

    for sequence, (name, time, content) in enumerate(all_messages):
        channel, schema, head = heads[name]
        time *= 1000
        first, last = min(first, time), max(last, time)
        counts[channel] = counts.get(channel, 0) + 1
        new = b"" if name in known else schema + head
        known.add(name)
        message = record(5, struct.pack("<HIQQ", channel, sequence, time, time) + content)
        if not chunked:
            out += new + message
            continue
        chunk += new
        index.setdefault(channel, []).append((time, len(chunk)))
        chunk += message
        if len(chunk) > 20_000:
            end_chunk()
    end_chunk()
    out += record(0x0C, sized("notes") + sized(b""))
    out += record(0x0F, struct.pack("<I", 0))
    if summary:
        at = len(out)
        out += b"".join(schema + head for _, schema, head in heads.values())
        out += record(0x0B, struct.pack("<QHIIIIQQ", len(all_messages), len(heads), len(heads), 0, 1, 0, first, last)
                      + sized(b"".join(struct.pack("<HQ", *count) for count in counts.items())))
        out += chunk_indexes + record(2, struct.pack("<QQI", at, 0, 0)) + magic
    else:
        out += record(2, struct.pack("<QQI", 0, 0, 0)) + magic
    path.write_bytes(out)


# ROS 1, version 2.0

def bag_record(data, **fields):
    header = b"".join(sized(name.encode() + b"=" + value) for name, value in fields.items())
    return sized(header) + sized(data)


def bag_time(microseconds):
    return struct.pack("<II", microseconds // 1_000_000, microseconds % 1_000_000 * 1000)


BAG_COMPRESS = {"none": bytes, "bz2": bz2.compress, "lz4": lambda content: lz4.frame.compress(
    content, block_size=lz4.frame.BLOCKSIZE_MAX4MB, block_linked=False, content_checksum=True, store_size=False)}


def write_bag(path, all_messages, topics, compression="none", index=True):
    magic, infos = b"#ROSBAG V2.0\n", b""
    connections = {}
    for number, (name, kind) in enumerate(topics.items()):
        fields = [("topic", name), ("type", kind), ("md5sum", "*"), ("message_definition", "")]
        data = b"".join(sized(f"{field}={value}") for field, value in fields)
        connections[name] = bag_record(data, conn=struct.pack("<I", number), topic=name.encode(), op=b"\7")
    numbers = {name: struct.pack("<I", number) for number, name in enumerate(topics)}
    chunks, known, chunk, entries, times = b"", set(), b"", {}, []
    chunk_count, start = 0, len(magic) + 4096

    def end_chunk():
        nonlocal chunks, chunk, infos, chunk_count
        if not chunk:
            return
        at = start + len(chunks)
        chunk_count += 1
        chunks += bag_record(BAG_COMPRESS[compression](chunk), compression=compression.encode(), op=b"\5",
                             size=struct.pack("<I", len(chunk)))
        for name, some in entries.items():
            data = b"".join(bag_time(t) + struct.pack("<I", offset) for t, offset in some)
            chunks += bag_record(data, ver=struct.pack("<I", 1), conn=numbers[name], op=b"\4",
                                 count=struct.pack("<I", len(some)))
        counts = b"".join(numbers[name] + struct.pack("<I", len(some)) for name, some in entries.items())
        infos += bag_record(counts, ver=struct.pack("<I", 1), chunk_pos=struct.pack("<Q", at), op=b"\6",
                            start_time=bag_time(min(times)), end_time=bag_time(max(times)),
                            count=struct.pack("<I", len(entries)))
        chunk = b""
        entries.clear()
        times.clear()

    for name, t, content in all_messages:
        if name not in known:
            chunk += connections[name]
            known.add(name)
        entries.setdefault(name, []).append((t, len(chunk)))
        times.append(t)
        chunk += bag_record(content, op=b"\2", conn=numbers[name], time=bag_time(t))
        if len(chunk) > 20_000:
            end_chunk()
    end_chunk()
    index_at = start + len(chunks) if index else 0
    fields = {"op": b"\3", "index_pos": struct.pack("<Q", index_at), "conn_count": struct.pack("<I", len(topics)),
              "chunk_count": struct.pack("<I", chunk_count)}
    header_size = len(bag_record(b"", **fields))
    out = magic + bag_record(b" " * (4096 - header_size), **fields) + chunks
    path.write_bytes(out + (b"".join(connections.values()) + infos if index else b""))


# ROS 2 with SQLite

def write_db3(path, all_messages, topics, page_size=4096):
    path.unlink(missing_ok=True)
    database = sqlite3.connect(path)
    database.execute(f"PRAGMA page_size = {page_size}")
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
                     "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
                     "timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
    database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    for number, (name, kind) in enumerate(topics.items()):
        database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (number + 1, name, kind.replace("/", "/msg/")))
    numbers = {name: number + 1 for number, name in enumerate(topics)}
    database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                         ((numbers[name], t * 1000, content) for name, t, content in all_messages))
    database.commit()
    database.close()


def write_arrays(bag, db3, events, per_packet, page_size=4096):
    """Bags of ROS 1 and of ROS 2 with nothing but these events."""
    global EVENTS, PER_PACKET
    EVENTS, PER_PACKET = events, per_packet
    FRAMES.clear()
    topics = {"/camera/events": EVENT_TYPES["array"]}
    write_bag(bag, messages(Ros1, "array"), topics)
    write_db3(db3, messages(Cdr, "array"), topics, page_size)


def main():
    folder = Path(sys.argv[1])
    if sys.argv[2:3] == ["given"]:
        events = [tuple(map(int, line.split())) for line in Path(sys.argv[3]).read_text().splitlines()]
        write_arrays(folder / "ros1.bag", folder / "ros2.db3", events, per_packet=1000)
        return
    for name, rows in ("events", EVENTS), ("frames", FRAMES):
        (folder / f"{name}.lines").write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))
    for name, kind, encoding, image in [("evt3", "packet", "evt3", "mono8"), ("mono", "packet", "mono", "rgb8"),
                                        ("libcaer", "packet", "libcaer", "mono8"),
                                        ("libcaer_cmp", "packet", "libcaer_cmp", "mono8"),
                                        ("array", "array", "", "mono8"), ("prophesee", "prophesee", "", "mono8")]:
        cdr, ros1 = (messages(serialization, kind, encoding, image) for serialization in (Cdr, Ros1))
        topics = topics_of(kind)
        write_mcap(folder / f"{name}.mcap", cdr, topics)
        if name.startswith("libcaer"):
            continue
        write_mcap(folder / f"{name}-ros1.mcap", ros1, topics, "zstd", ros1=True)
        write_bag(folder / f"{name}.bag", ros1, topics)
        write_db3(folder / f"{name}.db3", cdr, topics)
        if name == "evt3":
            for compression in "lz4", "zstd":
                write_mcap(folder / f"{name}-{compression}.mcap", cdr, topics, compression)
            write_mcap(folder / f"{name}-no-index.mcap", cdr, topics, "lz4", summary=False)
            write_mcap(folder / f"{name}-no-chunks.mcap", cdr, topics, chunked=False)
        if name == "mono":
            write_mcap(folder / "mono-restarted.mcap", messages(Cdr, kind, encoding, image, restart=30), topics)
            write_db3(folder / "mono-old.db3", cdr, topics_of("old"))
    write_bag(folder / "prophesee-bz2.bag", ros1, topics, "bz2")
    write_bag(folder / "prophesee-lz4.bag", ros1, topics, "lz4")
    write_bag(folder / "prophesee-no-index.bag", ros1, topics, "lz4", index=False)
    if sys.argv[2:] == ["many"]:
        fields = Cdr()
        array_of(fields, EVENTS[:1])
        message = ("/camera/events", START, fields.message())
        write_db3(folder / "many.db3", [message] * 200_000, {"/camera/events": EVENT_TYPES["array"]})


if __name__ == "__main__":
    main()
