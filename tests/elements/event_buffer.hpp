// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "tests/elements/harness.hpp"

inline eventcamera::Event on(int x, int y, std::uint32_t t = 0) {
  return eventcamera::Event::at(x, y, t, eventcamera::Polarity::on);
}
inline eventcamera::Event off(int x, int y, std::uint32_t t = 0) {
  return eventcamera::Event::at(x, y, t, eventcamera::Polarity::off);
}
inline eventcamera::AbsoluteEvent on_at(int x, int y, eventcamera::Microseconds t) {
  return eventcamera::AbsoluteEvent::at(x, y, t, eventcamera::Polarity::on);
}
inline eventcamera::AbsoluteEvent off_at(int x, int y, eventcamera::Microseconds t) {
  return eventcamera::AbsoluteEvent::at(x, y, t, eventcamera::Polarity::off);
}

/// Triggers on their way from a reader to a writer.
inline GstEvent* event_of(std::span<const eventcamera::Trigger> triggers) {
  std::vector<gint64> numbers;
  for (const auto& trigger : triggers)
    numbers.insert(numbers.end(),
                   {trigger.t, gint64{trigger.id} | (trigger.rising ? gint64{1} << 32 : 0)});
  GBytes* const records = g_bytes_new(numbers.data(), numbers.size() * sizeof numbers[0]);
  GstStructure* const structure =
      gst_structure_new("GstEventCameraTriggers", "records", G_TYPE_BYTES, records, nullptr);
  g_bytes_unref(records);
  return gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, structure);
}

/// Buffer of events whose times are relative to its PTS.
inline GstBuffer* buffer_of(GstClockTime pts, const std::vector<eventcamera::Event>& events,
                            GstClockTime duration) {
  GstBuffer* buffer = events.empty()
                          ? gst_buffer_new()
                          : gst_buffer_new_memdup(events.data(), events.size() * sizeof events[0]);
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
  return buffer;
}

/// Buffer of the events of [start, start + 10 ms).
inline GstBuffer* buffer_of(std::span<const eventcamera::AbsoluteEvent> events,
                            eventcamera::Microseconds start) {
  std::vector<GstEventCameraEvent> stream;
  for (const auto& event : events)
    stream.push_back({static_cast<guint32>(event.t - start), event.x, event.y_p});
  GstBuffer* buffer = gst_buffer_new_memdup(stream.data(), stream.size() * sizeof stream[0]);
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(start) * GST_USECOND;
  GST_BUFFER_DURATION(buffer) = 10 * GST_MSECOND;
  return buffer;
}

/// Pushes events in buffers of 10 ms.
inline void push_events(harness::Harness& h, std::span<const eventcamera::AbsoluteEvent> events) {
  while (!events.empty()) {
    const auto start = events.front().t / 10'000 * 10'000;
    const auto end =
        std::ranges::find_if(events, [&](const auto& event) { return event.t >= start + 10'000; });
    const auto count = static_cast<std::size_t>(end - events.begin());
    ASSERT_EQ(h.push(buffer_of(events.first(count), start)), GST_FLOW_OK);
    events = events.subspan(count);
  }
}

/// Appends the events of a buffer, with the times of their stream.
inline void append_events(GstBuffer* buffer, std::vector<eventcamera::AbsoluteEvent>& out) {
  const auto start = static_cast<eventcamera::Microseconds>(GST_BUFFER_PTS(buffer) / GST_USECOND);
  for (const auto& event : harness::events_of(buffer))
    out.push_back({start + event.t, event.x, event.y_p});
}

inline std::vector<eventcamera::AbsoluteEvent> pull_events(harness::Harness& h) {
  std::vector<eventcamera::AbsoluteEvent> events;
  while (const auto buffer = h.pull()) append_events(buffer.get(), events);
  return events;
}
