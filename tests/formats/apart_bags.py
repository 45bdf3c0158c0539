#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes bags whose images and events begin apart, and the events as text:

    apart_bags.py DIRECTORY

In late-events.*, more images than fit into a queue or into what a reader keeps come first; in
late-images.*, three seconds of events; in late-again.*, images pause for four seconds; images.bag has
only images."""
import sys
from pathlib import Path

import bag_files
from bag_files import DELAY, START, Cdr, Ros1

TOPICS = {"/camera/events": bag_files.EVENT_TYPES["array"], "/camera/image": bag_files.IMAGE_TYPE}


def image(fields, t, side):
    fields.header(t)
    fields.put("I", side, side)
    fields.text("mono8")
    fields.put("B", 0)
    fields.put("I", side)
    fields.array(bytes(side * side))
    return fields.message()


def events_message(fields, events):
    bag_files.array_of(fields, events)
    return fields.message()


def messages(serialization, events, images, side):
    """Events at the given times, 400 a message, and square images."""
    found = [("/camera/image", t + DELAY, image(serialization(), t, side)) for t in images]
    for first in range(0, len(events), 400):
        some = events[first:first + 400]
        found.append(("/camera/events", some[0][0] + DELAY, events_message(serialization(), some)))
    return sorted(found, key=lambda message: message[1])


def write(folder, name, events, images, side):
    ros1, cdr = (messages(kind, events, images, side) for kind in (Ros1, Cdr))
    bag_files.write_bag(folder / f"{name}.bag", ros1, TOPICS)
    bag_files.write_bag(folder / f"{name}-no-index.bag", ros1, TOPICS, index=False)
    bag_files.write_mcap(folder / f"{name}.mcap", cdr, TOPICS)
    bag_files.write_mcap(folder / f"{name}-no-index.mcap", cdr, TOPICS, summary=False)
    bag_files.write_db3(folder / f"{name}.db3", cdr, TOPICS)
    lines = ["t,x,y,p"] + [",".join(map(str, event)) for event in events]
    (folder / f"{name}.lines").write_text("\n".join(lines) + "\n")


def events_from(start, count):
    return [(START + start + 1000 * i, i % 300, i % 200, i % 2) for i in range(count)]


def main():
    folder = Path(sys.argv[1])
    images = [START + 40_000 * i for i in range(24)]
    write(folder, "late-events", events_from(800_000, 600), images, 1024)
    write(folder, "late-images", events_from(0, 4000), [t + 3_000_000 for t in images], 64)
    write(folder, "late-again", events_from(0, 8000), images[:12] + [t + 4_500_000 for t in images[12:]], 64)
    bag_files.write_bag(folder / "images.bag", messages(Ros1, [], images, 64), TOPICS, index=False)


main()
