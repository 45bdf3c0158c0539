// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/shot_noise.hpp"

namespace eventcamera {

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

/// Like solve_pixels(), for thresholds that do not vary; many pixels at a time.
void solve_row(const RowToSolve& row, UnsolvedPixels& unsolved);

}  // namespace eventcamera
