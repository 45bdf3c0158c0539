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

/// A pixel in which something may happen, and the light that it sees.
struct Candidate {
  int x;
  int shade;
  float last_target;  ///< at the start of the sub-interval
  float last_signal;
};

/// The candidates of a row by kind: each kind has a code path of its own, which is faster.
struct Candidates {
  std::vector<Candidate> without_noise;  ///< no shot noise in the sub-interval
  std::vector<Candidate> with_noise;

  void clear() {
    without_noise.clear();
    with_noise.clear();
  }
};

/// The widest vectors have this many floats; rows of luma values are padded for them.
inline constexpr int max_lanes = 16;

/// What all pixels share in a sub-interval.
struct RowFilter {
  const SubInterval& sub_interval;
  const ShadeTables& tables;
  const std::vector<float>& responses;  ///< to each luma value
  int luma_bits;
  bool has_bandwidth;
  bool has_noise;
};

/// Advances a row of pixels through a sub-interval: targets and signals of all, references and
/// noise budgets of those in which nothing can happen, which are most. The others go to
/// `candidates`. The decision leaves a margin for the rounding of floats, and is the same on every
/// processor. The luma values are std::uint8_t if they have 8 bits, std::uint16_t otherwise.
void filter_row(const RowFilter& row_filter, const void* luma, const PixelRow& pixels, int width,
                Candidates& candidates);

/// Advances single pixels through a sub-interval, exactly: crossings of the thresholds, leak, shot
/// noise, refractory period, latency.
class PixelSolver {
 public:
  PixelSolver(const DvsSettings& settings, const Random& random, const SubInterval& sub_interval);

  /// Moves reference, refractory_left and noise_budget of a row's candidates to the end of the
  /// sub-interval.
  void solve(const PixelRow& pixels, const Candidates& candidates, const ShadeTables& tables,
             const BandEvents& events) const;

 private:
  const DvsSettings& settings_;
  const Random& random_;
  const SubInterval& sub_interval_;
  bool only_crossings_;  ///< except for noise, an event is a crossing and nothing more
};

}  // namespace eventcamera
