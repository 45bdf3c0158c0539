// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <limits>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// Growth of a pixel's thresholds as a fraction of them, at a time in microseconds since the first
/// frame.
struct ThresholdGrowth {
  double time = 0;
  double value = 0;
};

/// Adaptation of thresholds: each event raises both thresholds of its pixel by a fraction, and the
/// growth falls at a constant rate. At strong edges, which are many thresholds high, pixels of real
/// cameras fire fewer events than their contrast is worth (docs/methods.md).
class Adaptation {
 public:
  explicit Adaptation(const DvsSettings& settings)
      : step_(settings.adaptation), rate_(step_ / in_microseconds(settings.adaptation_time)) {}

  bool is_on() const { return step_ > 0; }

  /// Growth by an event.
  double step() const { return step_; }
  /// Fall of the growth per microsecond.
  double rate() const { return rate_; }

  double at(double time, const ThresholdGrowth& growth) const {
    return std::max(0.0, growth.value - rate_ * (time - growth.time));
  }

 private:
  double step_;
  double rate_;
};

}  // namespace eventcamera
