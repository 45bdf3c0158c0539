// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <optional>

#include "src/simulate/frame_pacer.hpp"

/// Quality of service of a simulator: skips frames if downstream is late, and counts them. All
/// times are running times. Shared between threads, under a lock.
class SimulatorQos {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  /// Overrides the default.
  void enable(bool enabled) { enabled_ = enabled; }
  /// Sets the default: on for video, off for events.
  void take_output(bool is_video) { is_video_ = is_video; }
  bool is_enabled() const { return enabled_.value_or(is_video_); }

  /// Takes a QoS event from downstream.
  void take_event(GstBaseTransform* element, GstEvent* event);

  /// Starts processing a frame. If the frame is skipped instead, returns the message that reports
  /// it; only frames that end an interval are `skippable`.
  GstMessage* begin(GstBaseTransform* element, GstBuffer* frame, bool skippable);
  /// Time at which the work on the last frame began; none without a clock.
  std::optional<Nanoseconds> began() const { return began_; }
  /// Ends the work on a frame. It began at `began` or, if that is later, when the last output had
  /// been pushed. Returns its duration; 0 without a clock.
  Nanoseconds end_work(GstBaseTransform* element, std::optional<Nanoseconds> began);
  /// Extends the duration of the frame's picture over the frames that will probably be skipped
  /// next, because sinks drop a picture that arrives after its end.
  void extend(GstBaseTransform* element, GstBuffer* picture, GstClockTime frame_duration) const;
  /// Ends the processing of a frame, after the output has been pushed.
  void end(GstBaseTransform* element);

  /// Latency of downstream elements that they do not report.
  Nanoseconds downstream_latency() const { return pacer_.downstream_latency(); }

  /// Forgets the frames, at a new segment.
  void start_over() {
    pacer_.start_over();
    last_.reset();
    pushed_ = 0;
  }
  void reset_stats();
  GstStructure* stats() const;

 private:
  GstMessage* message(GstBaseTransform* element, GstBuffer* frame, GstClockTime running_time);

  std::optional<bool> enabled_;
  bool is_video_ = true;
  eventcamera::FramePacer pacer_;
  GstClockTimeDiff lateness_ = 0;     ///< of the last picture downstream
  gdouble proportion_ = 1;            ///< of real time that downstream needs
  std::optional<Nanoseconds> last_;   ///< frame that was processed last
  std::optional<Nanoseconds> began_;  ///< when the work on it began
  Nanoseconds pushed_ = 0;            ///< when the last output had been pushed
  guint64 frames_ = 0;
  guint64 skipped_ = 0;
  guint64 processing_time_ = 0;  ///< ns
};
