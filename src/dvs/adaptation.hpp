// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// Adaptation of thresholds: each event raises both thresholds of its pixel by a fraction, and the
/// growth falls at a constant rate. The growth is stored as the time at which it ends; each event
/// moves that by the adaptation time. At strong edges, which are many thresholds high, pixels of
/// real cameras fire fewer events than their contrast is worth (docs/methods.md). Times are
/// microseconds on any common clock.
class Adaptation {
 public:
  explicit Adaptation(const DvsSettings& settings)
      : duration_(in_microseconds(settings.adaptation_time)),
        rate_(settings.adaptation / duration_) {}

  bool is_on() const { return rate_ > 0; }

  /// Fall of the growth per microsecond.
  double rate() const { return rate_; }
  /// Time by which an event prolongs the growth.
  double duration() const { return duration_; }

  /// Growth at a time, as a fraction of the thresholds, if it ends at `end`.
  double growth(double time, double end) const { return rate_ * std::max(0.0, end - time); }

  /// End of the growth after an event at a time.
  double prolonged(double time, double end) const { return std::max(time, end) + duration_; }

 private:
  double duration_;
  double rate_;
};

}  // namespace eventcamera
