// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/readout.hpp"
#include "src/dvs/sub_intervals.hpp"
#include "src/dvs/trajectory.hpp"

namespace eventcamera {

/// A pixel in which something may happen, and its light.
struct Candidate {
  int x;
  int shade;
  float last_target;  ///< at the start of the sub-interval
  float last_signal;
};

/// Candidates of a row by kind, because each kind has its own fast path.
struct Candidates {
  std::vector<Candidate> without_noise;  ///< no shot noise in the sub-interval
  std::vector<Candidate> with_noise;

  void clear() {
    without_noise.clear();
    with_noise.clear();
  }
};

/// Maximum vector length in floats; rows of luma values are padded by this.
inline constexpr int max_lanes = 16;

/// Parameters of filter_row(), shared by all pixels in a sub-interval.
struct RowFilter {
  const SubInterval& sub_interval;
  const ShadeTables& tables;
  const std::vector<float>& responses;  ///< by luma value
  int luma_bits;
  bool has_bandwidth;
  bool has_noise;
};

/// Advances a row of pixels through a sub-interval: targets and signals of all pixels, references
/// and noise budgets of those in which nothing can happen, which are most. The others are added to
/// `candidates`. The decision has a margin for float rounding, and is the same on every processor.
/// Luma values are std::uint8_t if they have 8 bits, std::uint16_t otherwise.
void filter_row(const RowFilter& row_filter, const void* luma, const PixelRow& pixels, int width,
                Candidates& candidates);

/// Times of DvsSettings in microseconds.
struct Delays {
  double refractory_period;
  double latency;
  double latency_jitter;
};

/// Advances single pixels through a sub-interval, exactly: threshold crossings, leak, shot noise,
/// refractory period, latency.
class PixelSolver {
 public:
  PixelSolver(const DvsSettings& settings, const Random& random, const SubInterval& sub_interval);

  /// Advances reference, refractory_left and noise_budget of a row's candidates to the end of the
  /// sub-interval.
  void solve(const PixelRow& pixels, const Candidates& candidates, const ShadeTables& tables,
             const BandEvents& events) const;

 private:
  const DvsSettings& settings_;
  const Random& random_;
  const SubInterval& sub_interval_;
  Delays delays_;
  bool only_crossings_;  ///< events other than noise are crossings without side effects
};

}  // namespace eventcamera
