#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes small bags of ROS 1 and of ROS 2 with SQLite: bag_seeds.py DIRECTORY"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "formats"))
import bag_files  # noqa: E402

del bag_files.EVENTS[24:]
bag_files.FRAMES.clear()
bag_files.PER_PACKET = 6
folder = pathlib.Path(sys.argv[1])
topics = {"/camera/events": bag_files.EVENT_TYPES["array"]}
bag_files.write_bag(folder / "rosbag", bag_files.messages(bag_files.Ros1, "array"), topics)
# The smallest pages.
bag_files.write_db3(folder / "db3", bag_files.messages(bag_files.Cdr, "array"), topics, page_size=512)
