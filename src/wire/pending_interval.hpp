// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/invalid_events.hpp"
#include "src/core/sensor_size.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

/// Events to be sent: one interval, or several consecutive intervals joined.
class PendingInterval {
 public:
  explicit PendingInterval(SensorSize sensor) : sensor_(sensor) {}

  bool empty() const { return !is_open_; }
  Nanoseconds start() const { return start_; }
  Nanoseconds end() const { return end_; }
  /// Times are relative to `start`, rounded down to microseconds.
  std::span<const Event> events() const { return events_; }

  void clear() {
    is_open_ = false;
    events_.clear();
  }

  /// Adds an interval, which must start at the end of the pending one and not after max_rtp_start,
  /// with events relative to its start. Calls flush(), which must clear, whenever there are
  /// max_rtp_interval_events. Returns the events that cannot be sent.
  template <class Flush>
  InvalidEvents add(Nanoseconds start, Nanoseconds end, std::span<const Event> events,
                    const Flush& flush) {
    if (!is_open_) start_ = start;
    is_open_ = true;
    end_ = std::clamp(end, start, start_ + max_interval);
    InvalidEvents rejected;
    // Offset of event times, and their maximum.
    auto shift = microseconds(start) - microseconds(start_);
    const auto latest = microseconds(end_) - microseconds(start);
    std::uint32_t earliest = 0;
    for (const auto& event : events) {
      const bool is_outside = event.x >= sensor_.width || event.y() >= sensor_.height;
      if (is_outside || event.t < earliest || event.t > latest) {
        ++(is_outside ? rejected.outside : rejected.unsorted);
        continue;
      }
      if (events_.size() == max_rtp_interval_events) {
        split(flush);
        shift = microseconds(start) - microseconds(start_);
      }
      earliest = event.t;
      events_.push_back({static_cast<std::uint32_t>(event.t + shift), event.x, event.y_p});
    }
    return rejected;
  }

 private:
  static constexpr Microseconds microseconds(Nanoseconds time) { return time / 1000; }

  /// Flushes the events so far, and continues with the rest of the interval.
  template <class Flush>
  void split(const Flush& flush) {
    const auto end = end_;
    end_ = std::max(start_, (microseconds(start_) + events_.back().t) * 1000);
    const auto next = end_;
    flush();
    is_open_ = true;
    start_ = next;
    end_ = end;
  }

  SensorSize sensor_;
  bool is_open_ = false;
  Nanoseconds start_ = 0;
  Nanoseconds end_ = 0;
  std::vector<Event> events_;
};

}  // namespace eventcamera
