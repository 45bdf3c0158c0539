// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/dvs/adaptation.hpp"
#include "src/dvs/interval_events.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/row_filter.hpp"
#include "src/dvs/shade_tables.hpp"
#include "src/dvs/sub_intervals.hpp"

namespace eventcamera {

/// Maximum number of events of a pixel in one sub-interval, including those lost in its refractory
/// period; then its reference is set to its signal. A change from black to white is 35 events at
/// common thresholds.
inline constexpr int max_events = 512;

/// Minimum time between two events of a pixel, microseconds: the resolution of event times.
inline constexpr double min_gap = 1;

/// How pixels with these settings behave over time, in microseconds.
struct PixelDynamics {
  explicit PixelDynamics(const DvsSettings& settings)
      : adaptation(settings),
        thresholds(mean_thresholds(settings)),
        gap(std::max(in_microseconds(settings.refractory_period), min_gap)),
        latency(in_microseconds(settings.pixel_latency)),
        latency_jitter(in_microseconds(settings.pixel_latency_jitter)) {}

  Adaptation adaptation;
  ContrastThresholds thresholds;  ///< means
  double gap;                     ///< from an event until the pixel is ready for the next one
  double latency;
  double latency_jitter;
};

/// Candidates of a row to be advanced through a sub-interval.
struct RowToSolve {
  const DvsSettings& settings;
  const PixelDynamics& dynamics;
  const Random& random;
  const SubInterval& sub_interval;
  const ShadeTables& tables;
  const PixelRow& pixels;
  const Candidates& candidates;
  const IntervalEvents::Band& events;
  double start;  ///< of the sub-interval, microseconds since the first frame
  /// By how much more the start of the next interval is rounded down to microseconds than that of
  /// this one, if the sub-interval is the last; else 0.
  double next_rounding;

  bool has_labels() const { return pixels.last_cause != nullptr; }

  /// Rest of the refractory period at the end of the sub-interval. A rest of less than min_gap
  /// comes after an event in the last microsecond, which must not be that of the next one.
  double refractory_left(double ready) const {
    const double left = std::max(0.0, ready - sub_interval.duration);
    return left > 0 && left < min_gap ? left + next_rounding : left;
  }

  /// Cause of a crossing by pixel x, whose threshold is falling at `fall`, in light to which its
  /// signal answers with the slope `light`; both per microsecond (docs/methods.md).
  Cause cause_of_crossing(int x, Polarity polarity, double light, double fall) const {
    const double sign = polarity == Polarity::on ? 1 : -1;
    const double leak = sign * pixels.leak[x];
    const double pulse = sign * (sub_interval.rise / sub_interval.duration);
    const double fastest = std::max({0.0, sign * light, leak, pulse, fall});
    if (fastest <= sign * light || fastest == 0) return Cause::light;
    if (fastest == pulse) return Cause::exposure_pulse;
    if (fastest == fall) return pixels.last_cause[x];
    const auto number = pixels.first_number + static_cast<std::uint64_t>(x);
    return Mismatch(settings, random).is_hot(number) ? Cause::hot_pixel : Cause::leak;
  }

  /// Adds an event of pixel x, `t` microseconds after the start of the sub-interval. The cause is
  /// unknown unless events have labels.
  void add_event(int x, double t, Polarity polarity, Cause cause) const {
    if (has_labels()) pixels.last_cause[x] = cause;
    events.add(sub_interval.begin + t, x, pixels.y, polarity, cause);
  }
};

/// Advances reference, refractory_left and noise_budget of a row's candidates to the end of the
/// sub-interval, one pixel at a time, with exact threshold crossings, leak, shot noise, refractory
/// period and latency.
void solve_pixels(const RowToSolve& row);

/// Solves the candidates in which shot noise fires, one at a time, and removes them. The noise of
/// the others is done afterwards.
void solve_noisy_pixels(const RowToSolve& row, Candidates& candidates);

/// Solvers: solve_pixels(), or a faster one for settings that allow it.
enum class Solver { pixels, lines, row };
Solver solver_for(const DvsSettings& settings);

}  // namespace eventcamera
