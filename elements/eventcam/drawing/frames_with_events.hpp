// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <optional>
#include <span>
#include <vector>

#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/properties.hpp"

/// Video of the pad `video_sink`, and events of the pad `event_sink` up to a running time.
class FramesWithEvents : public EventAggregator {
 public:
  /// Logs in the element's category.
  FramesWithEvents(GstAggregator* element, GstDebugCategory* category);

  void stop() override;
  void flush() noexcept override;
  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override;

 protected:
  /// Forgets the frames and events so far, because a size changes or the input is discontinuous.
  virtual void start_over() noexcept = 0;
  /// Adds events; `origin` is a running time. Returns the numbers of dropped ones.
  virtual eventcamera::InvalidEvents add(std::span<const eventcamera::Event> events,
                                         eventcamera::Microseconds origin,
                                         eventcamera::Microseconds length) = 0;

  /// Adds the events up to running time `end`. Returns true if no more are expected before `end`.
  bool add_events_until(GstClockTime end);

  std::optional<GstVideoInfo> video_;
  std::optional<eventcamera::SensorSize> sensor_;
  GstClockTime known_ = 0;  ///< running time up to which events are complete

 private:
  std::span<const eventcamera::Event> in_running_time(std::span<const eventcamera::Event> events,
                                                      double rate);
  bool add_events(GstBuffer* buffer, const EventInterval& interval, GstClockTime end);
  bool handle_buffer(GstBuffer* buffer, GstClockTime end);

  GstDebugCategory* const category_;
  GstAggregatorPad* const events_pad_ = pad("event_sink");

  OwnedBuffer begun_;                       // first queued buffer, if some events were processed
  gsize processed_ = 0;                     // number of its processed events
  std::vector<eventcamera::Event> scaled_;  // in_running_time()
  WarnOnce warn_of_missing_;
};

/// Converts an interval to running time.
std::optional<EventInterval> running_interval(GstAggregatorPad* pad, const EventInterval& interval);
