// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/measure/stream_role.hpp"

namespace eventcamera {

/// Event counts of both streams in time bins of equal length. Bins start at a millisecond and are
/// merged in pairs whenever there are too many, so that memory does not grow with time.
class RateCurve {
 public:
  using Bin = PerRole<std::uint64_t>;
  static constexpr std::size_t max_bins = 1024;

  explicit RateCurve(Microseconds start = 0) : start_(start), covered_(start) {}

  /// Adds an event, which must not be before the start, nor before `end` of the last extend_to().
  void add(StreamRole role, Microseconds time) {
    if (time >= covered_) extend_to(time + 1);
    ++bins_.back()[role];
  }

  /// Adds empty bins up to `end`.
  void extend_to(Microseconds end);

  Microseconds bin_length() const { return length_; }
  /// The first bin begins at the start.
  std::span<const Bin> bins() const { return bins_; }

 private:
  std::size_t bin_of(Microseconds time) const {
    return static_cast<std::size_t>((time - start_) / length_);
  }
  void join_bins();

  Microseconds start_;
  Microseconds covered_;  ///< end of the last bin
  Microseconds length_ = 1000;
  std::vector<Bin> bins_;
};

/// Pearson correlation of the event counts of both streams in bins of a millisecond, in constant
/// memory.
class RateCorrelation {
 public:
  explicit RateCorrelation(Microseconds start = 0) : end_(start) {}

  /// Adds an event, which must not be before the start, nor in a bin before the last one.
  void add(StreamRole role, Microseconds time) {
    extend_to(time + 1);
    ++last_[role];
  }

  /// Adds empty bins up to `end`.
  void extend_to(Microseconds end);

  /// 0 if the counts of one stream are constant.
  double value() const;

 private:
  /// Sums over the counts in bins.
  struct Sums {
    double bins = 0;
    double product = 0;
    PerRole<double> counts;
    PerRole<double> squares;
  };
  static void add_bin(Sums& sums, const PerRole<double>& bin);

  Microseconds end_;  ///< of the last bin
  Sums sums_;         ///< without the last bin
  bool has_bin_ = false;
  PerRole<double> last_;  ///< the last bin
};

}  // namespace eventcamera
