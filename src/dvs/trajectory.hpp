// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "src/core/event.hpp"
#include "src/dvs/elementary.hpp"

namespace eventcamera {

/// Signal of a pixel over the time t in a sub-interval, microseconds: offset + slope t + lag
/// exp(-bandwidth t).
struct Trajectory {
  double offset = 0;
  double slope = 0;
  double lag = 0;        ///< 0 for a straight line
  double bandwidth = 0;  ///< 1/us

  double at(double t) const {
    const double straight = offset + slope * t;
    return lag == 0 ? straight : straight + lag * decay(bandwidth * t);
  }

  double slope_at(double t) const {
    return lag == 0 ? slope : slope - bandwidth * lag * decay(bandwidth * t);
  }

  /// A straight line from one value to another.
  static Trajectory line(double from, double to, double duration) {
    return {.offset = from, .slope = (to - from) / duration};
  }

  /// Exact output of a one-pole low-pass filter at `signal` whose input changes linearly.
  static Trajectory low_pass(double signal, double from, double to, double duration,
                             double bandwidth) {
    const double slope = (to - from) / duration;
    const double final_lag = slope / bandwidth;
    return {from - final_lag, slope, signal - (from - final_lag), bandwidth};
  }
};

/// A point of a trajectory.
struct TrajectoryPoint {
  double t;
  double value;
};

/// Point at which a trajectory reaches a level.
struct Crossing {
  TrajectoryPoint point;
  Polarity polarity;
};

/// A level missed by less than this counts as reached: bound of the float rounding that accumulates
/// over several events from one grey level to another and back.
inline constexpr float rounding = 2e-6F;

/// Precision of crossing times, microseconds.
inline constexpr double crossing_precision = 0.001;

/// More than bisection needs for this precision in any interval.
inline constexpr int max_iterations = 64;

/// Finds exact times at which a trajectory crosses levels.
class Crossings {
 public:
  /// Considers the trajectory up to the point `end`.
  Crossings(const Trajectory& trajectory, TrajectoryPoint end)
      : sign_(trajectory.lag < 0 ? -1 : 1),
        trajectory_{sign_ * trajectory.offset, sign_ * trajectory.slope, sign_ * trajectory.lag,
                    trajectory.bandwidth},
        end_{end.t, sign_ * end.value},
        last_slope_(slope_at(end_)) {}

  /// Returns the first point from `from` on at which the trajectory is at or above `upper` (ON), or
  /// at or below `lower` (OFF), if any.
  std::optional<Crossing> first(double lower, double upper, TrajectoryPoint from) const;

 private:
  double lag_at(TrajectoryPoint point) const {
    return point.value - trajectory_.offset - trajectory_.slope * point.t;
  }
  double slope_at(TrajectoryPoint point) const {
    return trajectory_.slope - trajectory_.bandwidth * lag_at(point);
  }
  TrajectoryPoint turn_after(TrajectoryPoint from) const;
  double time_of(double level, TrajectoryPoint a, TrajectoryPoint b) const;

  /// The trajectory times `sign_` has a slope that never decreases. So it may turn once, from
  /// falling to rising, and only the lower of two levels around it can be crossed in both
  /// directions.
  double sign_;
  Trajectory trajectory_;
  TrajectoryPoint end_;
  double last_slope_;
};

inline std::optional<Crossing> Crossings::first(double lower, double upper,
                                                TrajectoryPoint from) const {
  if (from.value >= upper) return Crossing{from, Polarity::on};
  if (from.value <= lower) return Crossing{from, Polarity::off};
  const TrajectoryPoint start{from.t, sign_ * from.value};
  const double near = sign_ > 0 ? lower : -upper;
  const double far = sign_ > 0 ? upper : -lower;
  const auto crossing = [&](double level, TrajectoryPoint a, TrajectoryPoint b) {
    return Crossing{{time_of(level, a, b), sign_ * level},
                    (level == far) == (sign_ > 0) ? Polarity::on : Polarity::off};
  };
  const double first_slope = slope_at(start);
  const bool ends_near = end_.value <= near;
  if (!ends_near && first_slope < 0 && last_slope_ > 0) {
    // It stays above the intersection of the tangents at its ends, which is cheap to compute.
    const double rise = end_.value - start.value;
    const double to_meeting =
        (rise - last_slope_ * (end_.t - start.t)) / (first_slope - last_slope_);
    if (start.value + first_slope * to_meeting <= near + rounding) {
      const auto turn = turn_after(start);
      if (turn.value <= near + rounding) return crossing(near, start, turn);
    }
  } else if (end_.value <= near + rounding) {
    return crossing(near, start, end_);
  }
  if (end_.value >= far - rounding) return crossing(far, start, end_);
  return std::nullopt;
}

}  // namespace eventcamera
