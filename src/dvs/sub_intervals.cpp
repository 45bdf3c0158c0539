// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/sub_intervals.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/dvs/light_response.hpp"
#include "src/dvs/shot_noise.hpp"

namespace eventcamera {
namespace {

constexpr double min_duration = 1;  // minimum duration of a sub-interval, microseconds

double rise_within(double begin, double end, std::span<const PulseEdge> edges) {
  double rise = 0;
  for (const auto& edge : edges) {
    const double within =
        std::min(end, edge.begin + PulseEdge::duration) - std::max(begin, edge.begin);
    rise += edge.rise * std::max(0.0, within) / PulseEdge::duration;
  }
  return rise;
}

}  // namespace

const std::vector<PulseEdge>& ExposurePulse::next(const DvsSettings& settings, double duration,
                                                  bool is_exposed) {
  constexpr double edge = PulseEdge::duration;
  edges_.clear();
  double free_from = 0;
  if (height_ > 0) {
    if (falls_in_ + edge > duration) {
      falls_in_ = std::max(0.0, falls_in_ - duration);
      return edges_;
    }
    edges_.push_back({falls_in_, -height_});
    free_from = falls_in_ + edge;
    height_ = 0;
  }
  const double begin = duration - std::max(in_microseconds(settings.exposure_lead), edge);
  if (!is_exposed || settings.exposure_pulse <= 0 || begin < free_from) return edges_;

  edges_.push_back({begin, settings.exposure_pulse});
  const double fall = begin + edge + plateau;
  if (fall + edge <= duration) {
    edges_.push_back({fall, -settings.exposure_pulse});
  } else {
    height_ = settings.exposure_pulse;
    falls_in_ = std::max(0.0, fall - duration);
  }
  return edges_;
}

ShadeTables::ShadeTables(const DvsSettings& settings, double microseconds, double gain)
    : duration(microseconds) {
  constexpr double min_cutoff_hz = 1e-3;  // minutes: a lower cutoff makes no difference
  constexpr double noise_at_white = 0.25;
  const double max_bandwidth =
      2 * std::numbers::pi * std::max(settings.cutoff_frequency, min_cutoff_hz) / 1e6;
  const double max_noise_rate = settings.shot_noise_rate / 1e6;
  for (std::size_t i = 0; i < shades; ++i) {
    const double light = light_of(static_cast<double>(i) / 255, settings.linear_light) / gain;
    // In (0, 1]: scales the bandwidth up and the noise down.
    const double brightness =
        std::min(1.0, (light + settings.dark_light) / (1 + settings.dark_light));
    bandwidth[i] = max_bandwidth * brightness;
    const double k = bandwidth[i] * duration;
    exponent[i] = static_cast<float>(k);
    decay_factor[i] = static_cast<float>(std::exp(-k));
    mean_decay_factor[i] = static_cast<float>(k > 0 ? -std::expm1(-k) / k : 1);
    expected_noise[i] =
        max_noise_rate * (1 - (1 - noise_at_white) * brightness) * duration * noise_unit;
    noise[i] = static_cast<std::uint32_t>(std::min(expected_noise[i], 4294967295.0));
  }
}

void Timeline::restart() {
  pulse_.reset();
  clock_ = 0;
  count_ = 0;
}

void Timeline::begin(const DvsSettings& settings, double gain, Nanoseconds last_time,
                     Nanoseconds duration, bool is_exposed) {
  constexpr std::size_t max_tables = 1000;  // of varying frame times
  if (settings != settings_ || gain != gain_ || tables_.size() > max_tables) tables_.clear();
  settings_ = settings;
  gain_ = gain;
  duration_ = in_microseconds(duration);
  const auto rounding_of = [](Nanoseconds time) { return in_microseconds(time % 1000); };
  next_rounding_ = std::max(0.0, rounding_of(last_time + duration) - rounding_of(last_time));
  edges_ = pulse_.next(settings, duration_, is_exposed);
  for (auto& plan : plans_) plan.clear();
  make_plan(1);
}

void Timeline::make_plan(int steps) {
  const auto index = static_cast<std::size_t>(steps);
  if (plans_.size() <= index) plans_.resize(index + 1);
  auto& plan = plans_[index];
  if (!plan.empty()) return;
  for (int step = 1; step <= steps; ++step) {
    double begin = duration_ * (step - 1) / steps;
    double left = duration_ / steps;
    const double step_end = begin + left;
    const auto add = [&](double end, double duration, double share) {
      plan.push_back({begin, duration, step, share, rise_within(begin, end, edges_),
                      count_ + plan.size(), clock_ + begin, 0, tables_of(duration)});
    };
    const auto cut = [&](double end) {
      const double passed = end - begin;
      if (passed < min_duration || left - passed < min_duration) return;
      add(end, passed, passed / left);
      begin = end;
      left -= passed;
    };
    for (const auto& edge : edges_) {
      cut(edge.begin);
      cut(edge.begin + PulseEdge::duration);
    }
    add(step_end, left, 1);
  }
  plan.back().next_rounding = next_rounding_;
}

void Timeline::end() {
  std::size_t most = 0;
  for (const auto& plan : plans_) most = std::max(most, plan.size());
  count_ += most;
  clock_ += duration_;
}

const ShadeTables* Timeline::tables_of(double duration) {
  const bool are_needed = settings_.cutoff_frequency > 0 || settings_.shot_noise_rate > 0;
  return &tables_.try_emplace(are_needed ? duration : 1, settings_, duration, gain_).first->second;
}

}  // namespace eventcamera
