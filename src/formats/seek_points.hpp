// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Position in a file at which a decoder can resume as if it had read everything before.
struct SeekPoint {
  Microseconds t = 0;  ///< time of the latest event before it; the minimum value if there is none
  std::uint64_t position = 0;  ///< offset in the file, bytes
  Microseconds clock = 0;      ///< private to the decoder
  std::uint64_t state = 0;     ///< private to the decoder
};

/// Seek points of the part of a file that was read. Their number is bounded for files of any
/// length.
class SeekPoints {
 public:
  bool due(std::uint64_t position) const { return position >= next_; }

  void note(const SeekPoint& seek_point) {
    known_.push_back(seek_point);
    if (known_.size() == max_count) {
      for (std::size_t i = 1; i < max_count / 2; ++i) known_[i] = known_[2 * i];
      known_.resize(max_count / 2);
      spacing_ *= 2;
    }
    next_ = seek_point.position + spacing_;
  }

  /// Returns the last seek point without events at `t` or later before it; none before the header
  /// is read.
  std::optional<SeekPoint> before(Microseconds t) const {
    if (known_.empty()) return std::nullopt;
    const auto later = std::partition_point(known_.begin() + 1, known_.end(),
                                            [t](const SeekPoint& known) { return known.t < t; });
    return *(later - 1);
  }

 private:
  static constexpr std::size_t max_count = 4096;

  std::vector<SeekPoint> known_;
  std::uint64_t spacing_ = std::uint64_t{1} << 16;
  std::uint64_t next_ = 0;
};

}  // namespace eventcamera
