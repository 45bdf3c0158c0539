// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/course.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

/// Of a crossing's time, microseconds.
constexpr double precision = 0.001;

/// Halving alone would find any time in an interval to that precision with fewer.
constexpr int max_iterations = 64;

}  // namespace

/// Where slope = bandwidth lag.
CoursePoint Crossings::turn_after(CoursePoint from) const {
  const double behind = course_.slope / course_.bandwidth;
  const double times_behind = lag_at(from) / behind;
  if (!(times_behind > 1)) return from;  // rounding
  const double t = from.t + std::log(times_behind) / course_.bandwidth;
  return t < end_.t ? CoursePoint{t, course_.offset + course_.slope * t + behind} : end_;
}

/// Of a level between `a` and `b` that is crossed once there, or missed by rounding: Halley's
/// method, kept between what is known.
double Crossings::time_of(double level, CoursePoint a, CoursePoint b) const {
  const double rise = level - a.value;
  const double duration = b.t - a.t;
  const double secant = std::clamp(rise / (b.value - a.value), 0.0, 1.0) * duration;
  if (course_.lag == 0) return a.t + secant;
  const double slope = course_.slope;
  const double bandwidth = course_.bandwidth;
  const double lag = lag_at(a);
  const bool rises = b.value > a.value;
  // Since a: slope t - lag (1 - exp(-bandwidth t)) = rise. With (2 - x) / (2 + x) for exp(-x) that
  // is a quadratic equation.
  const double half = slope - bandwidth * (lag + rise / 2);
  const double root = std::sqrt(std::max(0.0, half * half + 2 * slope * bandwidth * rise));
  double t = 2 * rise / (half + (rises ? root : -root));
  if (!(t >= 0 && t <= duration)) t = secant;
  double early = 0;
  double late = duration;
  for (int i = 0; i < max_iterations; ++i) {
    const double lag_left = lag * decay(bandwidth * t);
    const double beyond = slope * t - (lag - lag_left) - rise;
    const bool is_late = (beyond > 0) == rises;
    late = is_late ? t : late;
    early = is_late ? early : t;
    const double slope_here = slope - bandwidth * lag_left;
    const double bend = bandwidth * bandwidth * lag_left;
    const double step = 2 * beyond * slope_here / (2 * slope_here * slope_here - beyond * bend);
    const double next = t - step;
    const bool is_within = next >= early && next <= late;
    t = is_within ? next : (early + late) / 2;
    if (late - early < precision) break;
    // What is left after a step that is not too long goes with its third power, and more so near a
    // turn.
    const double slope_there = slope_here - bend * step;
    const double steep = std::min(slope_here * slope_here, slope_there * slope_there);
    const double left = std::abs(step * step * step) *
                        (bend * bend / 4 + std::abs(bend * bandwidth * slope_here) / 6);
    const bool is_short = bandwidth * std::abs(step) < 0.5;
    if (is_within && is_short && (std::abs(step) < precision || left < precision * steep)) break;
  }
  return a.t + t;
}

}  // namespace eventcamera
