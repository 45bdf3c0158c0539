// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// The sensor's size in pixels.
struct SensorSize {
  int width = 0;
  int height = 0;

  friend constexpr bool operator==(const SensorSize&, const SensorSize&) = default;
};

/// What a decoder hands over; it only appends.
struct Decoded {
  std::vector<AbsoluteEvent> events;
  std::vector<Trigger> triggers;
};

/// The bytes are not of this format at all, or of a version or codec that cannot be read; what()
/// says so in words for a user.
class UnsupportedFormat : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What was wrong with the bytes so far. A decoder skips it and goes on at the next sound place.
struct Corruption {
  std::uint64_t places = 0;    ///< how many
  std::uint64_t first_at = 0;  ///< byte position of the first, from the file's start
  std::string first;           ///< what it is, in words for a user
  std::uint64_t unsorted = 0;  ///< events earlier than one before them, delivered as read
  std::uint64_t outside = 0;   ///< events outside the sensor, dropped

  /// Notes one more place.
  void note(std::uint64_t at, const char* what) {
    if (places++ == 0) {
      first_at = at;
      first = what;
    }
  }
};

/// A position in a file where a decoder can resume as if it had read everything before it.
struct SeekPoint {
  Microseconds t = 0;          ///< of the latest event before it; the lowest number where none is
  std::uint64_t position = 0;  ///< bytes from the start of the file
  Microseconds clock = 0;      ///< private to the decoder
  std::uint64_t state = 0;     ///< private to the decoder
};

/// The seek points of the part of a file that was read: few, however long the file is.
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

  /// The last seek point with nothing at `t` or later before it; none before the header is read.
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

/// Reads one event format. Bytes come in pieces of any size: how they are split changes nothing.
/// Memory is bounded by the pieces given and by the format's largest unit, never by a length that
/// the bytes claim.
class Decoder {
 public:
  virtual ~Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Appends what `bytes` completes. Throws UnsupportedFormat.
  virtual void decode(std::span<const std::uint8_t> bytes, Decoded& out) = 0;

  /// Says that there are no more bytes: what is whole is appended, a rest is corruption. Throws
  /// UnsupportedFormat where there was not even a header.
  virtual void finish(Decoded& out) = 0;

  /// Where to restart to get every event at `t` or later, and some before. Nothing before the
  /// header is read, and in formats that can be read from their beginning only. Times are cut short
  /// and wrap in many formats: seek points are of what was read, and a seek past it restarts at the
  /// last.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const {
    return seek_points_.before(t);
  }

  /// The next bytes are those at the position of this seek point. Corruption that is read again
  /// counts again.
  virtual void restart(const SeekPoint& /*seek_point*/) {}

  /// The sensor's size, once its header is read or it is known from elsewhere; 0x0 before.
  SensorSize size() const { return size_; }

  const Corruption& corruption() const { return corruption_; }

 protected:
  Decoder() = default;

  SensorSize size_;
  Corruption corruption_;
  SeekPoints seek_points_;
};

}  // namespace eventcamera
