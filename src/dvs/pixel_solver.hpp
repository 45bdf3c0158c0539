// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/dvs/adaptation.hpp"
#include "src/dvs/interval_events.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/run.hpp"
#include "src/dvs/shot_noise.hpp"
#include "src/dvs/sub_intervals.hpp"
#include "src/dvs/trajectory.hpp"

namespace eventcamera {

/// Maximum vector length in floats; rows of luma values are padded by this.
inline constexpr int max_lanes = 16;

/// Pixels of a row in which something may happen.
class Candidates {
 public:
  /// Values of each of them: of the sub-interval, and, like those of PixelRow, at its start.
  enum Column : std::size_t {
    target,  ///< at the end of the sub-interval
    signal,
    last_target,
    last_signal,
    reference,
    positive,
    negative,
    leak,
    refractory_left,
    columns
  };

  std::size_t count = 0;
  std::vector<std::int32_t> x;
  std::vector<std::int32_t> shade;

  float* column(Column column) { return memory_.data() + column * x.size(); }
  const float* column(Column column) const { return memory_.data() + column * x.size(); }

  /// The last candidate takes the place of candidate i.
  void remove(std::size_t i) {
    --count;
    x[i] = x[count];
    shade[i] = shade[count];
    for (std::size_t first = 0; first < memory_.size(); first += x.size())
      memory_[first + i] = memory_[first + count];
  }

  /// Makes space for a row, padded for vectors.
  void resize(int width) {
    const auto size = static_cast<std::size_t>(width) + max_lanes;
    x.resize(size);
    shade.resize(size);
    memory_.resize(columns * size);
  }

 private:
  std::vector<float> memory_;
};

/// Parameters of filter_run(), shared by all pixels in a sub-interval.
struct RowFilter {
  const SubInterval& sub_interval;
  const ShadeTables& tables;
  const std::vector<float>& responses;  ///< by luma value
  int luma_bits;
  bool has_bandwidth;
  bool has_noise;
  bool keeps_saturated;  ///< saturated pixels keep a higher target
};

/// Luma of a run of pixels, from the first of them on: std::uint8_t if it has 8 bits, std::uint16_t
/// otherwise.
struct RunLuma {
  const void* target;  ///< towards which the light moves
  const void* shade;   ///< that bandwidth and noise depend on
};

/// Advances a run of pixels through a sub-interval: targets and signals of all pixels; references
/// and noise budgets of those that cannot fire, which are most. The others become `candidates`. The
/// decision has a margin for float rounding, and is the same on every processor. A run that does
/// not end with the row must be a multiple of max_lanes pixels wide.
void filter_run(const RowFilter& row_filter, const RunLuma& luma, const PixelRow& pixels,
                const Run& run, Candidates& candidates);

/// What light does at most during an interval, in units of the response.
struct LightRange {
  float darkest;
  float brightest;
  float max_rise;  ///< of all signals, beyond the light
  float max_fall;
};

/// Advances a run of pixels without bandwidth through a whole interval, for which `row_filter` and
/// `luma` are, if none of them can fire in it, whatever the light does within its range. Otherwise
/// returns false, and leaves them as they are.
bool rest_run(const RowFilter& row_filter, const LightRange& range, const RunLuma& luma,
              const PixelRow& pixels, const Run& run);

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
        threshold_jitter(settings.threshold_jitter),
        refractory_period(in_microseconds(settings.refractory_period)),
        gap(std::max(refractory_period, min_gap)),
        latency(in_microseconds(settings.pixel_latency)),
        latency_jitter(in_microseconds(settings.pixel_latency_jitter)) {}

  Adaptation adaptation;
  ContrastThresholds thresholds;  ///< means
  double threshold_jitter;
  double refractory_period;
  double gap;  ///< minimum time between two events without latency
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

  bool has_labels() const { return pixels.last_cause != nullptr; }

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

/// Pixels that solve_row() has not finished: a column per variable, a row per pixel.
class UnsolvedPixels {
 public:
  /// Times are microseconds after the start of the sub-interval. Values are multiplied by `sign`,
  /// so that the slope of the trajectory never decreases: it can only turn upwards, and the level
  /// above the reference is the far one.
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

/// Advances reference, refractory_left and noise_budget of a row's candidates to the end of the
/// sub-interval, one pixel at a time, with exact threshold crossings, leak, shot noise, refractory
/// period and latency.
void solve_pixels(const RowToSolve& row);

/// Solves the candidates in which shot noise fires, one at a time, and removes them. The noise of
/// the others is done afterwards.
void solve_noisy_pixels(const RowToSolve& row, Candidates& candidates);

/// Solvers: solve_pixels(), or a faster one for settings that allow it.
enum class Solver { pixels, lines, varying_thresholds, row };
Solver solver_for(const DvsSettings& settings);

/// Like solve_pixels(), for signals that are straight lines, and events that are crossings without
/// side effects except the refractory period.
void solve_lines(const RowToSolve& row);

/// Like solve_lines(), with thresholds that vary: by adaptation, and by jitter without mismatch.
void solve_varying_thresholds(const RowToSolve& row);

/// Like solve_pixels(), for events without side effects except the refractory period; many pixels
/// at a time.
void solve_row(const RowToSolve& row, UnsolvedPixels& unsolved);

}  // namespace eventcamera
