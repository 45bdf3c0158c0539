# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds the plugins that the programs need."""
from gi.repository import Gst


def find_plugins(names=("eventcam", "eventsim")):
    for plugin in names:
        if not Gst.Registry.get().find_plugin(plugin):
            raise RuntimeError(
                f"GStreamer does not find the plugin {plugin}. In a checkout, enter the development shell:"
                " meson devenv -C build -w .\nOtherwise install it: the Debian package"
                f" gstreamer1.0-{plugin}, or as root: meson install -C build")
