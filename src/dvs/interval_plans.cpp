// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/interval_plans.hpp"

#include <algorithm>

namespace eventcamera {

void IntervalPlans::begin(const DvsSettings& settings, double gain, double duration,
                          std::span<const PulseEdge> edges, int max_steps) {
  settings_ = settings;
  gain_ = gain;
  edges_.assign(edges.begin(), edges.end());
  duration_ = duration;
  constexpr std::size_t max_tables = 1000;  // of varying frame times
  if (tables_.size() > max_tables) tables_.clear();
  max_sub_intervals_ = 0;
  plans_.resize(static_cast<std::size_t>(max_steps) + 1);
  for (auto& plan : plans_) plan.sub_intervals.clear();
  make(1);
}

void IntervalPlans::make(int steps) {
  auto& plan = plans_[static_cast<std::size_t>(steps)];
  if (!plan.sub_intervals.empty()) return;
  divide_interval(duration_, steps, edges_, sub_interval_count_, plan.sub_intervals);
  plan.tables.clear();
  for (const auto& sub_interval : plan.sub_intervals)
    plan.tables.push_back(tables_of(sub_interval.duration));
  max_sub_intervals_ = std::max(max_sub_intervals_, plan.sub_intervals.size());
}

const ShadeTables* IntervalPlans::tables_of(double duration) {
  const bool are_needed = settings_.cutoff_frequency > 0 || settings_.shot_noise_rate > 0;
  return &tables_.try_emplace(are_needed ? duration : 1, settings_, duration, gain_).first->second;
}

}  // namespace eventcamera
