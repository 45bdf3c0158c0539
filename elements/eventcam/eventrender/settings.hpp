// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "gst/base/event_buffer.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/core/event.hpp"
#include "src/render/renderer.hpp"

namespace eventrender {

/// What the application sets, copied once per picture.
struct Settings {
  eventcamera::RenderMode mode = eventcamera::RenderMode::accumulate;
  GstEventCameraPalette palette = GST_EVENT_CAMERA_PALETTE_DARK;
  GstClockTime accumulation_time = 0;
  guint event_count = 0;
  guint area_event_count = 0;
  guint area_size = 16;
  gdouble full_scale = 2;
};

/// Those of the core; what a mode does not use keeps its default, so that a change of it goes
/// unnoticed.
eventcamera::RenderSettings core_settings(const Settings& settings);

/// Where a window that ends at `end` begins, which shows `interval`.
eventcamera::Microseconds window_start(const Settings& settings, const EventInterval& interval);

}  // namespace eventrender
