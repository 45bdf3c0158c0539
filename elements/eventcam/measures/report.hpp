// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "gst/base/event_buffer.hpp"
#include "gst/base/properties.hpp"
#include "src/measure/cause_counts.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/render/rgb_picture.hpp"

/// The part of an interval that is in a segment, if there is one.
inline std::optional<EventInterval> clip(EventInterval interval, const GstSegment& segment) {
  const gboolean is_inside = gst_segment_clip(&segment, GST_FORMAT_TIME, interval.start,
                                              interval.end, &interval.start, &interval.end);
  return is_inside ? std::optional(interval) : std::nullopt;
}

/// The events of a buffer, and their labels if it has any, that are in the clipped part of its
/// interval. They live as long as the buffer is mapped.
struct ClippedEvents {
  ClippedEvents(const MappedEvents& mapped, GstBuffer* buffer, const EventInterval& clipped)
      : labels(labels_of(buffer)) {
    const auto all = mapped.events();
    const auto& whole = mapped.interval();
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

/// Files that an element writes its results to; none if a path is empty.
struct ReportFiles {
  std::string location{};  ///< statistics, as JSON
  std::string map{};       ///< image of the events per pixel, as PNG
};

/// For class_init: adds the properties location and map, for settings derived from ReportFiles.
template <class Properties>
void add_report_properties(Properties& properties, const char* map_blurb) {
  properties.add_fixed(
      &ReportFiles::location, "location",
      "JSON file of the statistics, written at EOS, at the end of a segment or on stop");
  properties.add_fixed(&ReportFiles::map, "map", map_blurb);
}

eventcamera::Nanoseconds stream_time(const GstSegment& segment, GstClockTime time);

void put_figures(GstStructure* structure, const eventcamera::StreamFigures& figures);

/// Sets the fields of labelled events by cause; none if no event has a label.
void put_causes(GstStructure* structure, const eventcamera::CauseCounts& causes);

/// False, after an error message, if a folder of these files does not exist.
bool can_report(gpointer element, const ReportFiles& files);

/// Writes `figures` as JSON (nested structures as objects, arrays as arrays) and the image, and
/// posts `figures` as an element message. Takes ownership of `figures`.
void report(gpointer element, const ReportFiles& files, GstStructure* figures,
            const std::function<eventcamera::RgbPicture()>& draw);
