// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/settings.hpp"

#include <algorithm>

#include "gst/base/drawn_video.hpp"

namespace eventrender {

using eventcamera::Microseconds;
using eventcamera::RenderMode;
using eventcamera::RenderSettings;

/// How far decay and time-surface look back where the application leaves it open.
constexpr GstClockTime default_memory = 100 * GST_MSECOND;

RenderSettings core_settings(const Settings& settings) {
  RenderSettings core;
  core.mode = settings.mode;
  core.palette = palette_name_of(settings.palette);
  const auto time = settings.accumulation_time > 0 ? settings.accumulation_time : default_memory;
  const auto microseconds = static_cast<Microseconds>(std::max(time / 1000, GstClockTime{1}));
  if (settings.mode == RenderMode::decay || settings.mode == RenderMode::time_surface)
    core.time_constant = microseconds;
  else
    core.limits = {settings.event_count, settings.area_event_count,
                   static_cast<int>(settings.area_size)};
  if (settings.mode == RenderMode::decay || settings.mode == RenderMode::count)
    core.full_scale = static_cast<float>(settings.full_scale);
  return core;
}

Microseconds window_start(const Settings& settings, const EventInterval& interval) {
  if (settings.accumulation_time > 0)
    return interval.end > settings.accumulation_time
               ? static_cast<Microseconds>((interval.end - settings.accumulation_time) / 1000)
               : -1;
  if (settings.event_count > 0 || settings.area_event_count > 0) return -1;
  return static_cast<Microseconds>(interval.start / 1000);
}

}  // namespace eventrender
