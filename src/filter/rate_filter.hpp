// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

namespace eventcamera {

/// Limits the event rate. Keeps every n-th event, which spreads the drops over picture and period;
/// n follows from the event count of the last reference period, or of this one so far. A burst
/// within a period may keep up to 1.5 times the limit; later periods make up for it, with up to
/// half of their limit each. Fractions of events accumulate.
class RateFilter {
 public:
  struct Settings {
    std::uint64_t max_rate = 10'000'000;        ///< events per second; 0 = no limit
    Nanoseconds reference_period = 10'000'000;  ///< at least 1 us, rounded down to microseconds
  };

  explicit RateFilter(SensorSize) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings) {
    if (settings.max_rate == 0) return events;
    const Microseconds period = settings.reference_period / 1000;
    const double allowed =
        static_cast<double>(settings.max_rate) * static_cast<double>(period) / 1e6;
    return events.keep_if([&](const Event& event) {
      const Microseconds time = start + event.t;
      if (time >= end_) begin_period(time, period, allowed);
      ++received_;
      // One is added for each event that may pass.
      share_ += std::min(1.0, budget_ / std::max(expected_, received_));
      const bool is_due = share_ >= 1;
      share_ -= is_due ? 1 : 0;
      const bool is_kept = is_due && kept_ < budget_ + allowed / 2;
      kept_ += is_kept ? 1 : 0;
      return is_kept;
    });
  }

  void forget() { *this = RateFilter({}); }

 private:
  void begin_period(Microseconds time, Microseconds period, double allowed) {
    const Microseconds skipped = is_first_ ? 1 : (time - end_) / period;
    debt_ = std::max(-1.0, debt_ + kept_ - allowed * static_cast<double>(1 + skipped));
    budget_ = std::min(allowed - std::min(debt_, allowed / 2), std::ceil(allowed));
    expected_ = skipped == 0 ? received_ : 0;
    received_ = 0;
    kept_ = 0;
    end_ = (is_first_ ? time : end_ + skipped * period) + period;
    is_first_ = false;
  }

  bool is_first_ = true;
  Microseconds end_ = std::numeric_limits<Microseconds>::min();  ///< of the reference period
  double expected_ = 0;                                          ///< events of the last period
  double received_ = 0;                                          ///< events so far
  double kept_ = 0;
  double budget_ = 0;  ///< events to keep in this period
  double debt_ = -1;   ///< events kept in the past beyond the limit, at least -1
  double share_ = 0;   ///< of the next event that is kept
};
static_assert(Filter<RateFilter>);

}  // namespace eventcamera
