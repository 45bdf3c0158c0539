// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// Simultaneous rise of all signals, or fall if `rise` is negative.
struct PulseEdge {
  static constexpr double duration = 100;  ///< microseconds

  double begin;  ///< microseconds after the start of the interval
  double rise;   ///< units of the response
};

/// Cross-talk in cameras whose pixels output both frames and events, such as the DAVIS: when an
/// exposure begins, all signals rise a little and fall again. All pixels close to an ON event fire
/// at once, and hardly any fire during the pulse. The durations are from the recording slider-depth
/// of a DAVIS240C (docs/realism.md).
class ExposurePulse {
 public:
  static constexpr double plateau = 800;  ///< from one edge to the other, microseconds

  /// Returns the edges within the next interval, in time order. `is_exposed` is true if the
  /// interval ends with a frame, whose exposure began settings.exposure_lead earlier. A pulse that
  /// does not end within the interval ends in the next one; an exposure that began before the
  /// interval, or during another pulse, has no pulse.
  const std::vector<PulseEdge>& next(const DvsSettings& settings, double duration, bool is_exposed);

  /// Aborts the current pulse.
  void reset() { height_ = 0; }

 private:
  std::vector<PulseEdge> edges_;
  double height_ = 0;    ///< of the current pulse, or 0
  double falls_in_ = 0;  ///< microseconds from the start of the next interval
};

/// Number of luma levels for bandwidth and noise, which depend on the light (v2e) but need little
/// precision.
inline constexpr int shades = 256;

/// Bandwidth and noise of pixels of each shade in a sub-interval.
struct ShadeTables {
  std::array<float, shades> exponent;           ///< k = bandwidth times duration
  std::array<float, shades> decay_factor;       ///< exp(-k), decay of the lag behind the light
  std::array<float, shades> mean_decay_factor;  ///< (1 - exp(-k)) / k, its mean over the duration
  std::array<std::uint32_t, shades> noise;      ///< expected shot noise, 1/noise_unit

  std::array<double, shades> bandwidth;  ///< 1/us
  std::array<double, shades> expected_noise;

  double duration;  ///< microseconds

  /// For a frame with `gain` times the exposure of the first one.
  ShadeTables(const DvsSettings& settings, double microseconds, double gain);
};

/// Part of an interval in which the light of each pixel, and the pulses added to all signals,
/// change linearly.
struct SubInterval {
  double begin;          ///< microseconds after the start of the interval
  double duration;       ///< microseconds
  int step;              ///< 1 ... steps; the light moves towards its value at the end of this step
  double share;          ///< fraction of the remaining change that is made
  double rise;           ///< rise of all signals, units of the response
  std::uint64_t number;  ///< counted from the first frame
  double start;          ///< microseconds since the first frame
  /// Rounding error of the next interval's start, less this interval's, microseconds; 0 unless this
  /// is the last sub-interval.
  double next_rounding;
  const ShadeTables* tables;
};

/// Timeline since the first frame. Divides each interval into equal steps, and splits them where
/// pulse edges begin and end. One plan per number of steps.
class Timeline {
 public:
  using Plan = std::vector<SubInterval>;  ///< in order of time

  /// Begins the interval of `duration` after `last_time`, in a frame with `gain` times the exposure
  /// of the first one. `is_exposed` as in ExposurePulse. Makes the plan of a single step.
  void begin(const DvsSettings& settings, double gain, Nanoseconds last_time, Nanoseconds duration,
             bool is_exposed);

  /// Duration of the interval, microseconds.
  double duration() const { return duration_; }

  /// Makes the plan of this many steps, if it is not made yet.
  void make_plan(int steps);

  const Plan& plan(int steps) const { return plans_[steps]; }

  /// Ends the interval: the sub-intervals of the next one have larger numbers.
  void end();

  /// Aborts the current pulse.
  void end_pulse() { pulse_.reset(); }

  /// The next frame is the first one.
  void restart();

 private:
  const ShadeTables* tables_of(double duration);

  DvsSettings settings_;
  double gain_ = 1;
  ExposurePulse pulse_;
  std::vector<PulseEdge> edges_;
  double duration_ = 0;
  double next_rounding_ = 0;
  double clock_ = 0;                      ///< start of the interval
  std::uint64_t count_ = 0;               ///< sub-intervals before the interval
  std::map<double, ShadeTables> tables_;  ///< by duration, microseconds
  std::vector<Plan> plans_;               ///< by number of steps
};

}  // namespace eventcamera
