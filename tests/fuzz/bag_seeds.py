#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes small bags of ROS 1 and of ROS 2 with SQLite: bag_seeds.py DIRECTORY"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "formats"))
import bag_files  # noqa: E402

folder = pathlib.Path(sys.argv[1])
# The smallest pages.
bag_files.write_arrays(folder / "rosbag", folder / "db3", bag_files.EVENTS[:24], per_packet=6, page_size=512)
