/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

/* Returns FALSE, and prints what to do, if GStreamer lacks the plugin eventcam. */
gboolean find_plugin(void);

G_END_DECLS
