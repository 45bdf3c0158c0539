// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/trajectory.hpp"

#include <cmath>

namespace eventcamera {

/// Turning point after `from`: slope = bandwidth lag.
TrajectoryPoint Crossings::turn_after(TrajectoryPoint from) const {
  const double final_lag = trajectory_.slope / trajectory_.bandwidth;
  const double ratio = lag_at(from) / final_lag;
  if (!(ratio > 1)) return from;  // due to rounding
  const double t = from.t + logarithm(ratio) / trajectory_.bandwidth;
  return t < end_.t ? TrajectoryPoint{t, trajectory_.offset + trajectory_.slope * t + final_lag}
                    : end_;
}

/// Returns the time at which a level is crossed between `a` and `b`. It must be crossed once there,
/// or missed by rounding. Halley's method, with bisection as fallback.
double Crossings::time_of(double level, TrajectoryPoint a, TrajectoryPoint b) const {
  constexpr double precision = crossing_precision;
  const double rise = level - a.value;
  const double duration = b.t - a.t;
  const double secant = std::clamp(rise / (b.value - a.value), 0.0, 1.0) * duration;
  if (trajectory_.lag == 0) return a.t + secant;
  const double slope = trajectory_.slope;
  const double bandwidth = trajectory_.bandwidth;
  const double lag = lag_at(a);
  const bool rises = b.value > a.value;
  // Relative to a: slope t - lag (1 - exp(-bandwidth t)) = rise. Approximating exp(-x) by (2 - x) /
  // (2 + x) gives a quadratic equation.
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
    const double curvature = bandwidth * bandwidth * lag_left;
    const double step =
        2 * beyond * slope_here / (2 * slope_here * slope_here - beyond * curvature);
    const double next = t - step;
    const bool is_within = next >= early && next <= late;
    t = is_within ? next : (early + late) / 2;
    if (late - early < precision) break;
    // The error after a short step is of third order in the step, and larger near a turn.
    const double slope_there = slope_here - curvature * step;
    const double min_slope_squared = std::min(slope_here * slope_here, slope_there * slope_there);
    const double error =
        std::abs(step * step * step) *
        (curvature * curvature / 4 + std::abs(curvature * bandwidth * slope_here) / 6);
    const bool is_short = bandwidth * std::abs(step) < 0.5;
    if (is_within && is_short &&
        (std::abs(step) < precision || error < precision * min_slope_squared))
      break;
  }
  return a.t + t;
}

}  // namespace eventcamera
