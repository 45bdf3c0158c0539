// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/random.hpp"

namespace eventcamera {

/// Minimum time between two events of a pixel, microseconds: the resolution of event times.
inline constexpr double min_gap = 1;

/// A threshold of 0 would fire forever.
inline constexpr double min_threshold = 1e-3;

/// Minimum threshold of pixels that vary around a mean.
inline double min_threshold_of(double mean) {
  return std::max(mean / 10, min_threshold);
}

struct ContrastThresholds {
  double positive;  ///< infinite if the pixel is dead
  double negative;
};

struct PixelTraits {
  ContrastThresholds thresholds;
  double leak;  ///< fall of the reference per microsecond
};

/// Adaptation of thresholds: each event raises both thresholds of its pixel by a fraction, and the
/// growth falls at a constant rate. The growth is stored as the time at which it ends; each event
/// moves that by the adaptation time. Times are microseconds since the first frame.
class Adaptation {
 public:
  explicit Adaptation(const DvsSettings& settings)
      : duration_(in_microseconds(settings.adaptation_time)),
        rate_(settings.adaptation / duration_) {}

  bool is_on() const { return rate_ > 0; }

  /// Fall of the growth per microsecond.
  double rate() const { return rate_; }
  /// Time by which an event prolongs the growth.
  double duration() const { return duration_; }

  /// Growth at a time, as a fraction of the thresholds, if it ends at `end`.
  double growth(double time, double end) const { return rate_ * std::max(0.0, end - time); }

  /// End of the growth after an event at a time.
  double prolonged(double time, double end) const { return std::max(time, end) + duration_; }

 private:
  double duration_;
  double rate_;
};

/// Pixel solvers: solve_pixels(), or a faster one if the settings allow it.
enum class Solver { pixels, lines, row };

/// Pixels with these settings: shared parameters, and the mismatch that the seed determines. Times
/// are microseconds.
class PixelModel {
 public:
  explicit PixelModel(const DvsSettings& settings);

  bool has_bandwidth() const { return settings.cutoff_frequency > 0; }
  bool has_noise() const { return settings.shot_noise_rate > 0; }
  bool has_threshold_jitter() const { return settings.threshold_jitter > 0; }
  /// True if the refractory period holds the reference at the signal.
  bool holds_reference() const { return settings.refractory_reset == RefractoryReset::signal; }

  PixelTraits traits_of(std::uint64_t pixel) const;
  bool is_hot(std::uint64_t pixel) const;

  /// Thresholds after event `counter`, if they vary between events.
  ContrastThresholds next_thresholds(std::uint64_t pixel, std::uint64_t counter) const;

  /// Fall of the reference before the first frame, if noise resets it and the camera has been on
  /// for a long time.
  double leaked(std::uint64_t pixel, const PixelTraits& traits) const;

  DvsSettings settings;
  Random random;
  Adaptation adaptation;
  ContrastThresholds mean_thresholds;
  double gap;  ///< from an event until the pixel is ready for the next one
  double latency;
  double latency_jitter;
  Solver solver;

 private:
  double defect_of(std::uint64_t pixel) const;
  ContrastThresholds fixed_thresholds(std::uint64_t pixel) const;
};

}  // namespace eventcamera
