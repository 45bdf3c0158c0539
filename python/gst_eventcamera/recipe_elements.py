# SPDX-License-Identifier: LGPL-2.1-or-later
"""The elements that a recipe may use, which neither open files nor send anything."""
from __future__ import annotations

import re

from .pipeline import Gst

SIMULATORS = re.compile(r"(gl)?eventsim-[a-z]+")
# One sink and one source pad each.
ELEMENTS = {
    "aspectratiocrop", "capsfilter", "deinterlace", "eventantiflicker", "eventcrop", "eventdenoise", "eventflip",
    "eventhotpixel", "eventpolarity", "eventratecontrol", "eventrefractory", "eventscale", "eventtensor", "eventtrail",
    "gamma", "glcolorconvert", "gldownload", "glupload", "identity", "queue", "videobalance", "videobox",
    "videoconvert", "videoconvertscale", "videocrop", "videoflip", "videomedian", "videorate", "videoscale"}
# Types of properties; texts may name files, addresses and other elements.
TYPES = {"gboolean", "gint", "guint", "gint64", "guint64", "gfloat", "gdouble", "GstFraction", "GstCaps"}

NAME = r"[a-zA-Z][a-zA-Z0-9_-]*"
VALUE = r"""(?:[a-zA-Z0-9_./:+()-]+|"[a-zA-Z0-9_./:+(),= -]*")"""
ELEMENT = re.compile(rf"({NAME})((?:\s+{NAME}={VALUE})*)")
PROPERTY = re.compile(rf"({NAME})=")
CAPS = re.compile(rf"{NAME}/{NAME}(?:\s*,\s*{NAME}\s*=\s*{VALUE})*")


def is_safe_property(element: str, name: str) -> bool:
    """Whether a property is a number, a choice or caps; also true if there is none of this name."""
    spec = Gst.ElementFactory.make(element).find_property(name)
    return spec is None or spec.value_type.name in TYPES or spec.value_type.fundamental.name in ("GEnum", "GFlags")


def reason_against(chain: str) -> str:
    """Why a chain of elements may not run; empty if it may. Its syntax is a subset of gst-launch-1.0's, without names
    of elements, so that no element refers to another."""
    for part in filter(None, map(str.strip, chain.split("!"))):
        if CAPS.fullmatch(part):
            continue
        match = ELEMENT.fullmatch(part)
        if not match:
            return f"\"{part}\" is neither an element with properties nor caps"
        element = match[1]
        if Gst.ElementFactory.find(element) is None:
            return f"there is no element \"{element}\""
        if element not in ELEMENTS and not SIMULATORS.fullmatch(element):
            return f"{element} is none of the elements that recipes run"
        for name in PROPERTY.findall(match[2]):
            if not is_safe_property(element, name):
                return f"{element}: {name} may name a file or an address"
    return ""
