// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/shade_tables.hpp"
#include "src/dvs/sub_intervals.hpp"

namespace eventcamera {

/// An interval in a number of steps.
struct IntervalPlan {
  std::vector<SubInterval> sub_intervals;  ///< in order of time
  std::vector<const ShadeTables*> tables;  ///< of each of them
};

/// Divides intervals into sub-intervals, in as many ways as its parts have steps, and knows
/// bandwidth and noise in each.
class IntervalPlans {
 public:
  /// Begins an interval of `duration` microseconds with these pulse edges, whose plans have up to
  /// `max_steps` steps, in a frame with `gain` times the exposure of the first one. Makes the plan
  /// of a single step.
  void begin(const DvsSettings& settings, double gain, double duration,
             std::span<const PulseEdge> edges, int max_steps);

  /// Makes the plan of this many steps, if it is not made yet.
  void make(int steps);

  /// Ends the interval: the sub-intervals of the next one have larger numbers.
  void end() { sub_interval_count_ += max_sub_intervals_; }

  /// A plan that was made.
  const IntervalPlan& at(int steps) const { return plans_[static_cast<std::size_t>(steps)]; }

  /// The interval as a single sub-interval.
  const SubInterval& whole() const { return whole_; }
  const ShadeTables& whole_tables() const { return *whole_tables_; }

  /// Maximum rise and fall of all signals by pulses within the interval.
  float max_rise() const { return max_rise_; }
  float max_fall() const { return max_fall_; }

  /// Must be called when settings or gain change.
  void clear_tables() { tables_.clear(); }

  /// Numbers sub-intervals from 0 again.
  void restart() { sub_interval_count_ = 0; }

 private:
  const ShadeTables* tables_of(double duration);

  DvsSettings settings_;
  double gain_ = 1;
  std::vector<PulseEdge> edges_;
  SubInterval whole_{};
  const ShadeTables* whole_tables_ = nullptr;
  float max_rise_ = 0;
  float max_fall_ = 0;
  std::map<double, ShadeTables> tables_;  ///< by duration, microseconds
  std::vector<IntervalPlan> plans_;       ///< by number of steps
  std::size_t max_sub_intervals_ = 0;     ///< of a plan
  std::uint64_t sub_interval_count_ = 0;  ///< before this interval
};

}  // namespace eventcamera
