/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "plugin.h"

#include <stdio.h>

gboolean find_plugin(void) {
  GstPlugin* plugin = gst_registry_find_plugin(gst_registry_get(), "eventcam");
  if (plugin == NULL) {
    fprintf(
        stderr,
        "GStreamer does not find the plugin eventcam. In a checkout, enter the development shell: "
        "meson devenv -C build -w .\nOtherwise install it: the Debian package "
        "gstreamer1.0-eventcam, or as root: meson install -C build\n");
    return FALSE;
  }
  gst_object_unref(plugin);
  return TRUE;
}
