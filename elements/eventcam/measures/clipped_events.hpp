// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>

#include "gst/base/event_buffer.hpp"

/// The part of an interval that is in a segment, if there is one.
inline std::optional<EventInterval> clip(EventInterval interval, const GstSegment& segment) {
  const gboolean is_inside = gst_segment_clip(&segment, GST_FORMAT_TIME, interval.start,
                                              interval.end, &interval.start, &interval.end);
  return is_inside ? std::optional(interval) : std::nullopt;
}

/// The events of a buffer, and their labels if it has any, that are in the clipped part of its
/// whole interval. They live as long as the buffer is mapped.
struct ClippedEvents {
  ClippedEvents(const MappedEvents& mapped, GstBuffer* buffer, const EventInterval& whole,
                const EventInterval& clipped)
      : labels(labels_of(buffer)) {
    const auto all = mapped.events();
    const auto time_of = [&](const auto& event) { return whole.start + event.t * GST_USECOND; };
    const auto first = std::ranges::find_if(
        all, [&](const auto& event) { return time_of(event) + event_resolution > clipped.start; });
    const auto last = std::ranges::find_if(all.rbegin(), all.rend(), [&](const auto& event) {
      return clipped.end == whole.end || time_of(event) < clipped.end;
    });
    events = {first, last.base()};
    if (!labels.empty())
      labels = labels.subspan(static_cast<std::size_t>(first - all.begin()), events.size());
  }

  std::span<const eventcamera::Event> events;
  std::span<const eventcamera::Label> labels;
};
