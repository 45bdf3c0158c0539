// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/eventcamera/eventcamera.h"
#include "src/render/palette.hpp"

/// The formats events can be drawn in, the most usual first.
#define DRAWN_VIDEO_FORMATS "{ BGRx, RGBx, xRGB, xBGR, BGRA, RGBA, ARGB, ABGR, RGB, BGR, GRAY8 }"

/// How events are drawn into a video of DRAWN_VIDEO_FORMATS.
eventcamera::PixelLayout pixel_layout_of(const GstVideoInfo& info);

/// What the core calls an application's palette.
eventcamera::PaletteName palette_name_of(GstEventCameraPalette palette);

/// Decides, in an answered allocation query, that pictures come from downstream's pool, or one of
/// ours. False where these caps are not video.
bool decide_on_drawn_pool(GstQuery* query, GstCaps* caps);
