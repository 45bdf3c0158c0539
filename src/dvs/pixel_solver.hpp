// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/dvs/interval_events.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_model.hpp"
#include "src/dvs/row_filter.hpp"
#include "src/dvs/shot_noise.hpp"
#include "src/dvs/sub_intervals.hpp"

namespace eventcamera {

/// Maximum number of events of a pixel in one sub-interval, including events lost in its refractory
/// period; then its reference is set to its signal. A change from black to white takes 35 events at
/// common thresholds.
inline constexpr int max_events = 512;

/// Pixels that solve_row() has not finished: a column per variable, a row per pixel.
class UnsolvedPixels {
 public:
  /// Times are microseconds after the start of the sub-interval. Values are multiplied by `sign`,
  /// so that the slope of the trajectory never decreases: it can only turn upwards. The level above
  /// the reference is the far one, the level below the near one.
  enum Column : std::size_t {
    index,  ///< in Candidates
    sign,
    t,      ///< of the last event
    value,  ///< of the signal at t
    end,    ///< value at the end of the sub-interval
    offset,
    slope,
    bandwidth,
    reference,
    to_far,   ///< from the reference to the far level
    to_near,  ///< from the near level to the reference
    ready,    ///< earliest time of the next event
    next_noise,
    columns
  };

  std::vector<ShotNoise> noise;      ///< by index
  std::vector<std::uint64_t> draws;  ///< by index: the counter of the next random number

  void resize(std::size_t size) {
    size_ = size;
    if (noise.size() >= size) return;
    noise.resize(size);
    draws.resize(size);
    memory_.resize(columns * size);
  }
  double* column(Column column) { return memory_.data() + column * size_; }

 private:
  std::size_t size_ = 0;
  std::vector<double> memory_;
};

/// Candidates of a row, and the parameters to advance them through a sub-interval. Each thread
/// keeps one to reuse its memory; model and events are set for each band.
struct RowToSolve {
  const PixelModel* model = nullptr;
  IntervalEvents::Band events;
  PixelRow pixels;
  const SubInterval* sub_interval = nullptr;
  Candidates candidates;
  UnsolvedPixels unsolved;  ///< of solve_row()

  bool has_labels() const { return pixels.last_cause != nullptr; }

  /// Rest of the refractory period at the end of the sub-interval. A rest below min_gap follows an
  /// event in the last microsecond, in which the pixel must not fire again.
  double refractory_left(double ready) const {
    const double left = std::max(0.0, ready - sub_interval->duration);
    return left > 0 && left < min_gap ? left + sub_interval->next_rounding : left;
  }

  /// Cause of a crossing by pixel x (docs/methods.md). `fall` is the rate at which its threshold
  /// falls, `light` the slope of its signal due to light; both per microsecond.
  Cause cause_of_crossing(int x, Polarity polarity, double light, double fall) const {
    const double sign = polarity == Polarity::on ? 1 : -1;
    const double leak = sign * pixels.leak[x];
    const double pulse = sign * (sub_interval->rise / sub_interval->duration);
    const double fastest = std::max({0.0, sign * light, leak, pulse, fall});
    if (fastest <= sign * light || fastest == 0) return Cause::light;
    if (fastest == pulse) return Cause::exposure_pulse;
    if (fastest == fall) return pixels.last_cause[x];
    return model->is_hot(pixels.number_of(x)) ? Cause::hot_pixel : Cause::leak;
  }

  /// Adds an event of pixel x, `t` microseconds after the start of the sub-interval. The cause is
  /// unknown unless events have labels.
  void add_event(int x, double t, Polarity polarity, Cause cause) {
    if (has_labels()) pixels.last_cause[x] = cause;
    events.add(sub_interval->begin + t, with_cause(Event::at(x, pixels.y, 0, polarity), cause));
  }
};

/// Advances reference, refractory_left and noise_budget of a row's candidates to the end of the
/// sub-interval, one pixel at a time, with exact threshold crossings, leak, shot noise, refractory
/// period and latency.
void solve_pixels(RowToSolve& row);

/// Solves the candidates in which shot noise fires, one at a time, and removes them. Advances the
/// noise budgets of the others.
void solve_noisy_pixels(RowToSolve& row);

/// Like solve_pixels(), for Solver::lines: straight-line signals without latency, whose reference
/// after an event is the crossed level. Many pixels at a time.
void solve_lines(RowToSolve& row);

/// Like solve_pixels(), for thresholds that do not vary. Many pixels at a time.
void solve_row(RowToSolve& row);

}  // namespace eventcamera
