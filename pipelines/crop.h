/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Crops event streams.
 */
#pragma once

#include <gst/gst.h>

typedef struct {
  guint width, height, x, y;
} Region;

/* Parses WIDTHxHEIGHT+X+Y. Returns FALSE if the text is invalid. */
gboolean region_from_text(Region* region, const char* text);

/* Makes a pad push only the events within the region, moved to (0, 0). The region must outlive the
 * pad. */
void crop_events(GstPad* pad, const Region* region);
