// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// A place in a file where a decoder can go on as though it had read all that is before.
struct SeekPoint {
  Microseconds t;           ///< of the latest event before; the smallest number where there is none
  std::uint64_t position;   ///< bytes from the file's start
  Microseconds clock = 0;   ///< the decoder's own
  std::uint64_t state = 0;  ///< the decoder's own
};

/// The seek points of a file as far as it was read: few, however long it is.
class SeekPoints {
 public:
  bool due(std::uint64_t position) const { return position >= next_; }

  void note(const SeekPoint& seek_point) {
    known_.push_back(seek_point);
    if (known_.size() == most) {
      for (std::size_t i = 1; i < most / 2; ++i) known_[i] = known_[2 * i];
      known_.resize(most / 2);
      spacing_ *= 2;
    }
    next_ = seek_point.position + spacing_;
  }

  /// The last one before which nothing is at `t` or later; none before the header is read.
  std::optional<SeekPoint> before(Microseconds t) const {
    if (known_.empty()) return std::nullopt;
    const auto later = std::partition_point(known_.begin() + 1, known_.end(),
                                            [t](const SeekPoint& known) { return known.t < t; });
    return *(later - 1);
  }

 private:
  static constexpr std::size_t most = 4096;

  std::vector<SeekPoint> known_;
  std::uint64_t spacing_ = std::uint64_t{1} << 16;
  std::uint64_t next_ = 0;
};

/// A decoder that can go back to what it has read, and on from there. Times in these files are cut
/// short and wrap, so that a place in the middle tells its time only to who has read all before:
/// to seek forwards, restart at the last seek point and read on.
class SeekableDecoder : public Decoder {
 public:
  /// Where to restart so as to get every event at `t` or later (and some before); none before the
  /// header is read.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const {
    return seek_points_.before(t);
  }

  /// The next bytes are those at the seek point's position. Corruption that is read again counts
  /// again.
  virtual void restart(const SeekPoint& seek_point) = 0;

 protected:
  SeekPoints seek_points_;
};

}  // namespace eventcamera
