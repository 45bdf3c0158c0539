// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/absolute_event.hpp"
#include "src/measure/side.hpp"

namespace eventcamera {

/// How many events each side has in stretches of time of one length. They begin at a millisecond,
/// and are joined by twos whenever there are too many, so that the curve of a day has as many.
class RateCurve {
 public:
  using Bin = OfSides<std::uint64_t>;
  static constexpr std::size_t max_bins = 1024;

  explicit RateCurve(Microseconds start = 0) : start_(start), covered_(start) {}

  /// An event after the start, and after `end` of the last extend_to().
  void add(Side side, Microseconds time) {
    if (time > covered_) extend_to(time);
    ++bins_.back()[side];
  }

  /// There is time up to `end`.
  void extend_to(Microseconds end);

  Microseconds bin_length() const { return length_; }
  /// The first begins at the start.
  std::span<const Bin> bins() const { return bins_; }

 private:
  /// Of time after the start: (start, start + length] is bin 0.
  std::size_t bin_of(Microseconds time) const {
    return static_cast<std::size_t>((time - start_ - 1) / length_);
  }
  void join_bins();

  Microseconds start_;
  Microseconds covered_;  ///< where the last bin ends
  Microseconds length_ = 1000;
  std::vector<Bin> bins_;
};

}  // namespace eventcamera
