// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <optional>

#include "src/core/event.hpp"
#include "src/dvs/decay.hpp"

namespace eventcamera {

/// How something in a pixel goes with time t, from 0 to an end, microseconds:
/// offset + slope t + lag exp(-bandwidth t).
struct Course {
  double offset = 0;
  double slope = 0;
  double lag = 0;        ///< 0 where it is a straight line
  double bandwidth = 0;  ///< 1/us

  double at(double t) const {
    const double straight = offset + slope * t;
    return lag == 0 ? straight : straight + lag * decay(bandwidth * t);
  }

  /// On a straight line from one value to another.
  static Course line(double from, double to, double duration) {
    return {.offset = from, .slope = (to - from) / duration};
  }

  /// Of the output of a low pass of one pole that is at `signal` when its input sets out on a
  /// straight line: exactly.
  static Course low_pass(double signal, double from, double to, double duration, double bandwidth) {
    const double slope = (to - from) / duration;
    const double behind = slope / bandwidth;  // where it stays in the end
    return {from - behind, slope, signal - (from - behind), bandwidth};
  }
};

/// A place on a course.
struct CoursePoint {
  double t;
  double value;
};

/// Where a course reaches a level.
struct Crossing {
  CoursePoint point;
  Polarity polarity;
};

/// A level that is missed by less counts as reached: that much floats are rounded on the way up
/// from a grey level and back to it, some events each.
inline constexpr float rounding = 2e-6F;

/// Finds where a course crosses levels, each at its exact time.
class Crossings {
 public:
  /// Up to the point `end`.
  Crossings(const Course& course, CoursePoint end)
      : side_(course.lag < 0 ? -1 : 1),
        course_{side_ * course.offset, side_ * course.slope, side_ * course.lag, course.bandwidth},
        end_{end.t, side_ * end.value},
        last_slope_(slope_at(end_)) {}

  /// The first point from `from` on at which the course is at or over `upper` (ON), or at or under
  /// `lower` (OFF), if there is one.
  std::optional<Crossing> first(double lower, double upper, CoursePoint from) const;

 private:
  double lag_at(CoursePoint point) const {
    return point.value - course_.offset - course_.slope * point.t;
  }
  double slope_at(CoursePoint point) const {
    return course_.slope - course_.bandwidth * lag_at(point);
  }
  CoursePoint turn_after(CoursePoint from) const;
  double time_of(double level, CoursePoint a, CoursePoint b) const;

  /// The course, if need be upside down: its slope never falls. So it may turn once from falling
  /// to rising, and of two levels around it the lower is the one that it may come back from.
  double side_;
  Course course_;
  CoursePoint end_;
  double last_slope_;
};

inline std::optional<Crossing> Crossings::first(double lower, double upper,
                                                CoursePoint from) const {
  if (from.value >= upper) return Crossing{from, Polarity::on};
  if (from.value <= lower) return Crossing{from, Polarity::off};
  const CoursePoint start{from.t, side_ * from.value};
  const double near = side_ > 0 ? lower : -upper;
  const double far = side_ > 0 ? upper : -lower;
  const auto crossing = [&](double level, CoursePoint a, CoursePoint b) {
    return Crossing{{time_of(level, a, b), side_ * level},
                    (level == far) == (side_ > 0) ? Polarity::on : Polarity::off};
  };
  const double first_slope = slope_at(start);
  const bool ends_near = end_.value <= near;
  if (!ends_near && first_slope < 0 && last_slope_ > 0) {
    // Not under the place where the tangents at both ends meet, which takes no logarithm to find.
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
