/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Crops event streams.
 */
#pragma once

#include <gst/gst.h>

typedef struct {
  guint width, height, x, y;
} Region;

/* Parses WIDTHxHEIGHT+X+Y. FALSE if the text is something else. */
gboolean region_from_text(Region* region, const char* text);

/* Makes a pad push the events within the region only, moved to (0, 0). The region must outlive the
 * pad. */
void crop_events(GstPad* pad, const Region* region);
