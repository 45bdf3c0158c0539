// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <limits>

#include "gst/base/event_buffer.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/types.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "src/render/renderer.hpp"

/// User-settable values of eventrender, copied once per picture.
struct RenderProperties {
  eventcamera::RenderMode mode = eventcamera::RenderMode::accumulate;
  eventcamera::PaletteName palette = eventcamera::PaletteName::dark;
  GstClockTime accumulation_time = 0;
  guint event_count = 0;
  guint area_event_count = 0;
  guint area_size = 16;
  gdouble full_scale = 2;

  /// Settings of the renderer. Those that a mode does not use keep their defaults, so that changing
  /// them does not reset the picture.
  eventcamera::RenderSettings of_renderer() const {
    using eventcamera::RenderMode;
    /// Default time constant of decay and maximum age of time-surface.
    constexpr GstClockTime default_memory = 100 * GST_MSECOND;
    eventcamera::RenderSettings settings;
    settings.mode = mode;
    settings.palette = palette;
    const auto time = accumulation_time > 0 ? accumulation_time : default_memory;
    if (mode == RenderMode::decay || mode == RenderMode::time_surface)
      settings.time_constant =
          static_cast<eventcamera::Microseconds>(std::max(time / 1000, GstClockTime{1}));
    else
      settings.limits = {event_count, area_event_count, static_cast<int>(area_size)};
    if (mode == RenderMode::decay || mode == RenderMode::count)
      settings.full_scale = static_cast<float>(full_scale);
    return settings;
  }

  /// Start of the window for the picture of an interval.
  eventcamera::Microseconds window_start(const EventInterval& interval) const {
    using eventcamera::Microseconds;
    if (accumulation_time > 0)
      return interval.end > accumulation_time
                 ? static_cast<Microseconds>((interval.end - accumulation_time) / 1000)
                 : -1;
    if (event_count > 0 || area_event_count > 0) return -1;
    return static_cast<Microseconds>(interval.start / 1000);
  }
};

inline GType render_mode_type() {
  using eventcamera::RenderMode;
  static const GEnumValue values[] = {
      {static_cast<gint>(RenderMode::accumulate), "Polarities that fired within a window",
       "accumulate"},
      {static_cast<gint>(RenderMode::decay), "Exponentially decaying sum of ON minus OFF", "decay"},
      {static_cast<gint>(RenderMode::time_surface), "Age and polarity of the last event",
       "time-surface"},
      {static_cast<gint>(RenderMode::count), "ON minus OFF within a window", "count"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventRenderMode", values);
}

/// Adds the properties of eventrender. Settings are RenderProperties.
template <auto settings_of>
void add_render_properties(Properties<settings_of>& properties) {
  constexpr RenderProperties defaults;
  properties.add(&RenderProperties::mode,
                 g_param_spec_enum("mode", "Mode", "What a picture shows", render_mode_type(),
                                   static_cast<gint>(defaults.mode), mutable_playing_flags));
  properties.add(
      &RenderProperties::palette,
      g_param_spec_enum("palette", "Palette",
                        "Colours of the picture; viridis and magma show magnitude, not polarity",
                        palette_type(), static_cast<int>(defaults.palette), mutable_playing_flags));
  properties.add(
      &RenderProperties::accumulation_time,
      g_param_spec_uint64(
          "accumulation-time", "Accumulation time",
          "Length of the window of accumulate and count, time constant of decay, maximum age of "
          "time-surface (ns; 0 = for accumulate and count, one frame, or as long as event-count "
          "and area-event-count allow; for the others, 100 ms)",
          0, std::numeric_limits<gint64>::max(), defaults.accumulation_time,
          mutable_playing_flags));
  properties.add(
      &RenderProperties::event_count,
      g_param_spec_uint("event-count", "Event count",
                        "Maximum number of events in the window of accumulate and count (events; "
                        "0 = no limit)",
                        0, eventcamera::RecentEvents::max_size, defaults.event_count,
                        mutable_playing_flags));
  properties.add(
      &RenderProperties::area_event_count,
      g_param_spec_uint("area-event-count", "Area event count",
                        "Maximum number of events per area in the window of accumulate and count: "
                        "the busiest area determines its length (events; 0 = no limit)",
                        0, eventcamera::RecentEvents::max_size, defaults.area_event_count,
                        mutable_playing_flags));
  properties.add(
      &RenderProperties::area_size,
      g_param_spec_uint("area-size", "Area size",
                        "Side of the squares that area-event-count counts in (pixels)", 1,
                        eventcamera::max_side, defaults.area_size, mutable_playing_flags));
  properties.add(
      &RenderProperties::full_scale,
      g_param_spec_double("full-scale", "Full scale",
                          "Number of events of a pixel shown in full colour by decay and count "
                          "(events)",
                          0.1, 1e6, defaults.full_scale, mutable_playing_flags));
}
