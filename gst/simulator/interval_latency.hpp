// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>

#include "src/simulate/learnt_latency.hpp"

/// Delay from the start of an interval to its output: its duration, and the work on it.
class IntervalLatency {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  IntervalLatency() { work_.expect(0); }

  /// Sets the duration of intervals according to the caps.
  void expect(Nanoseconds duration) { duration_.expect(duration); }
  /// Adapts to an interval: the framerate in the caps may be missing or wrong.
  void add_interval(Nanoseconds start, Nanoseconds end) {
    duration_.add(end, std::min(end - start, max));
  }
  /// Adapts to the work on the frame of this time, and to the latency that elements downstream do
  /// not report.
  void add_work(Nanoseconds time, Nanoseconds work, Nanoseconds downstream) {
    work_.add(time, std::min(work, max) / processing_deadline * processing_deadline);
    downstream_ = downstream;
  }

  Nanoseconds duration() const { return duration_.value(); }
  GstClockTime total() const {
    return static_cast<GstClockTime>(duration_.value() + work_.value() + downstream_);
  }

 private:
  /// Maximum duration, and maximum work.
  static constexpr Nanoseconds max = GST_SECOND;
  /// Default processing-deadline of sinks: processing time that they already add to the latency.
  /// More is reported in multiples of it.
  static constexpr Nanoseconds processing_deadline = 20 * GST_MSECOND;

  eventcamera::LearntLatency duration_;
  eventcamera::LearntLatency work_;
  Nanoseconds downstream_ = 0;
};
