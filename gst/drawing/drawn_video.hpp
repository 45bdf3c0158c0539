// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "src/render/palette.hpp"

/// Video formats that events can be drawn in, the most common first, and those with colours.
#define COLOUR_FORMATS "{ BGRx, RGBx, xRGB, xBGR, BGRA, RGBA, ARGB, ABGR, RGB, BGR }"
#define DRAWN_VIDEO_FORMATS "{ BGRx, RGBx, xRGB, xBGR, BGRA, RGBA, ARGB, ABGR, RGB, BGR, GRAY8 }"

eventcamera::PixelLayout pixel_layout_of(const GstVideoInfo& info);

GType palette_type();

/// Copies the metas of a frame to the picture of its events, if they remain valid although the
/// colours differ: those that depend only on size, orientation and time, such as crop and regions
/// of interest.
void keep_metas(GstBuffer* frame, GstBuffer* picture);

/// For decide_allocation(): uses downstream's buffer pool if it offers one that takes such buffers,
/// else a new video pool. `kept` is the number of buffers that the element keeps.
/// False if `caps` are not video.
bool decide_on_drawn_pool(GstQuery* query, GstCaps* caps, guint kept = 0);
