// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <optional>

#include "gst/base/guarded.hpp"
#include "gst/simulator/interval_latency.hpp"
#include "gst/simulator/qos.hpp"

/// When a simulator processes frames: skips them if downstream is late, and measures its latency,
/// which it announces when that changes.
class FrameTiming {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  FrameTiming(GstBaseTransform* element, GstDebugCategory* category)
      : element_(element), category_(category) {}

  /// Starts processing a frame. Returns false if the frame is skipped instead; only frames that end
  /// an interval are `skippable`.
  bool begin(GstBuffer* frame, bool skippable);
  /// Time at which the work on the last frame began; none without a clock.
  std::optional<Nanoseconds> began() { return qos_.lock()->began(); }
  /// Ends the work on the frame of this time, which `began` then.
  void end_work(Nanoseconds time, std::optional<Nanoseconds> began);
  /// Ends the processing of a frame, after its output has been pushed.
  void end() { qos_.lock()->end(element_); }

  /// Sets the duration of intervals according to the caps.
  void expect(Nanoseconds duration);
  /// Adapts the latency to an interval.
  void add_interval(Nanoseconds start, Nanoseconds end);
  /// Duration of the last intervals.
  Nanoseconds interval() { return latency_.lock()->duration(); }
  GstClockTime latency() { return latency_.lock()->total(); }

  /// Forgets the latency, on stop.
  void reset() { *latency_.lock() = {}; }

  Guarded<SimulatorQos>& qos() { return qos_; }

 private:
  template <class Change>
  void change_latency(const Change& change);

  GstBaseTransform* element_;
  GstDebugCategory* category_;
  Guarded<SimulatorQos> qos_;
  Guarded<IntervalLatency> latency_;
};
