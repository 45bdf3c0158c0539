// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/drawing/frames_with_events.hpp"

#include <limits>

#include "gst/base/video_frame.hpp"

#define GST_CAT_DEFAULT category_

using namespace eventcamera;

std::optional<EventInterval> running_interval(GstAggregatorPad* pad,
                                              const EventInterval& interval) {
  const auto start = running_time(pad, interval.start);
  if (!start) return std::nullopt;
  constexpr auto max = static_cast<double>(G_MAXINT64);
  const auto length = static_cast<double>(interval.end - interval.start) / segment_of(pad).rate;
  return EventInterval{*start, *start + static_cast<GstClockTime>(std::min(length, max))};
}

FramesWithEvents::FramesWithEvents(GstAggregator* element, GstDebugCategory* category)
    : EventAggregator(element, {.verb = "draw", .main_pad = "video_sink"}),
      category_(category),
      warn_of_missing_(category) {}

void FramesWithEvents::stop() {
  flush();
  video_.reset();
  sensor_.reset();
  warn_of_missing_.reset();
}

void FramesWithEvents::flush() noexcept {
  start_over();
  begun_.reset();
  known_ = 0;
}

bool FramesWithEvents::handle_caps(GstAggregatorPad* pad, GstCaps* caps) {
  if (pad != main_pad()) {
    const auto sensor = sensor_of(caps);
    if (!sensor) return false;
    if (sensor_ && sensor_ != sensor) start_over();
    sensor_ = sensor;
    return true;
  }
  GstVideoInfo video;
  if (!gst_video_info_from_caps(&video, caps)) return false;
  if (!video_ || GST_VIDEO_INFO_WIDTH(&*video_) != GST_VIDEO_INFO_WIDTH(&video) ||
      GST_VIDEO_INFO_HEIGHT(&*video_) != GST_VIDEO_INFO_HEIGHT(&video))
    start_over();
  video_ = video;
  const GstClockTime latency = frame_duration(video);
  GST_DEBUG_OBJECT(element(), "latency %" GST_TIME_FORMAT ", one frame", GST_TIME_ARGS(latency));
  gst_aggregator_set_latency(element(), latency, latency);
  if (!gst_pad_is_linked(GST_PAD(events_pad_)))
    warn_of_missing_(element(),
                     {GST_CORE_ERROR_PAD,
                      "No events to draw: link a source of events to the pad \"event_sink\". Until "
                      "then, video from a live source passes unchanged, and other video waits."},
                     "the pad \"event_sink\" is not linked");
  return true;
}

/// The events of a buffer, with times scaled by the rate to differences of running time.
std::span<const Event> FramesWithEvents::in_running_time(std::span<const Event> events,
                                                         double rate) {
  if (rate == 1) return events;
  constexpr double max = std::numeric_limits<std::uint32_t>::max();
  scaled_.assign(events.begin(), events.end());
  for (auto& event : scaled_) event.t = static_cast<std::uint32_t>(std::min(event.t / rate, max));
  return scaled_;
}

/// Adds the events of a buffer, whose `interval` is in running time, up to running time `end`.
/// Returns true if these were all.
bool FramesWithEvents::add_events(GstBuffer* buffer, const EventInterval& interval,
                                  GstClockTime end) {
  const MappedEvents mapped(buffer);
  if (!mapped) {
    warn(event_fault(buffer), buffer);
    return true;
  }
  const auto origin = microseconds(interval.start);
  const double rate = segment_of(events_pad_).rate;
  const auto rest = mapped.events().subspan(std::min(processed_, mapped.events().size()));
  if (processed_ == 0)
    GST_LOG_OBJECT(events_pad_, "%" G_GSIZE_FORMAT " events at running time %" GST_TIME_FORMAT,
                   rest.size(), GST_TIME_ARGS(interval.start));
  const auto length = static_cast<double>(microseconds(end) - origin) * rate;
  const auto due =
      end < interval.end ? events_until(rest, 0, static_cast<Microseconds>(length)) : rest;
  processed_ += due.size();
  warn(add(in_running_time(due, rate), origin, length_of(interval)), buffer);
  return due.size() == rest.size();
}

/// Adds the events of the first queued buffer up to running time `end`. Returns true if more are
/// needed to reach `end`.
bool FramesWithEvents::handle_buffer(GstBuffer* buffer, GstClockTime end) {
  const auto interval = interval_of(buffer);
  const auto running = interval ? running_interval(events_pad_, *interval) : std::nullopt;
  if (!interval)
    warn(event_fault(buffer), buffer);
  else if (!running)
    GST_LOG_OBJECT(events_pad_, "outside the segment: dropped %" GST_PTR_FORMAT, buffer);
  if (begun_.get() != buffer) processed_ = 0;
  if (running) {
    if (running->start >= end) return false;
    if (!add_events(buffer, *running, end)) {
      begun_.reset(gst_buffer_ref(buffer));
      return false;
    }
    known_ = std::max(known_, running->end);
  }
  begun_.reset();
  gst_aggregator_pad_drop_buffer(events_pad_);
  return known_ + event_resolution <= end;
}

bool FramesWithEvents::add_events_until(GstClockTime end) {
  while (known_ + event_resolution <= end) {
    const auto buffer = next_buffer(events_pad_);
    if (!buffer) return has_ended(events_pad_);
    if (!handle_buffer(buffer.get(), end)) return true;
  }
  return true;
}
