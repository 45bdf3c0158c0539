// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <utility>

#include "src/core/event.hpp"

/// Point at which a timeline continues from a state that was restored, so that a long video can be
/// simulated in segments.
class Continuation {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  /// True for the first frame or GAP of a timeline, before which a state is restored.
  bool begins() { return std::exchange(begins_, false); }
  /// Sets the time of the state.
  void restored(std::optional<Nanoseconds> time) { time_ = time; }

  /// Time of the state, until a frame continues from it.
  std::optional<Nanoseconds> time() const { return time_; }
  /// True if the state has seen the frame of this PTS.
  bool is_after(GstClockTime pts) const {
    return time_ && pts <= static_cast<GstClockTime>(*time_);
  }
  /// A frame is taken; true if it continues from the state.
  bool continues() { return std::exchange(time_, {}).has_value(); }

 private:
  bool begins_ = true;
  std::optional<Nanoseconds> time_;
};
