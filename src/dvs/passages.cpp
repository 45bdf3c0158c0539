// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/passages.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

/// Microseconds. No passage is shorter.
constexpr double shortest = 1;

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

void cut_into_passages(double duration, int steps, std::span<const PulseEdge> edges,
                       std::vector<Passage>& passages) {
  passages.clear();
  for (int step = 1; step <= steps; ++step) {
    double begin = duration * (step - 1) / steps;
    double left = duration / steps;
    const double step_end = begin + left;
    const auto cut = [&](double end) {
      const double passed = end - begin;
      if (passed < shortest || left - passed < shortest) return;
      passages.push_back({begin, passed, step, passed / left, rise_within(begin, end, edges)});
      begin = end;
      left -= passed;
    };
    for (const auto& edge : edges) {
      cut(edge.begin);
      cut(edge.begin + PulseEdge::duration);
    }
    passages.push_back({begin, left, step, 1, rise_within(begin, step_end, edges)});
  }
}

}  // namespace eventcamera
