// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/sub_intervals.hpp"

#include <algorithm>

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

void divide_interval(double duration, int steps, std::span<const PulseEdge> edges,
                     std::uint64_t number, std::vector<SubInterval>& sub_intervals) {
  sub_intervals.clear();
  for (int step = 1; step <= steps; ++step) {
    double begin = duration * (step - 1) / steps;
    double left = duration / steps;
    const double step_end = begin + left;
    const auto cut = [&](double end) {
      const double passed = end - begin;
      if (passed < min_duration || left - passed < min_duration) return;
      sub_intervals.push_back(
          {begin, passed, step, passed / left, rise_within(begin, end, edges), number++});
      begin = end;
      left -= passed;
    };
    for (const auto& edge : edges) {
      cut(edge.begin);
      cut(edge.begin + PulseEdge::duration);
    }
    sub_intervals.push_back({begin, left, step, 1, rise_within(begin, step_end, edges), number++});
  }
}

}  // namespace eventcamera
