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
#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// Sensor size in pixels.
struct SensorSize {
  int width = 0;
  int height = 0;

  friend constexpr bool operator==(const SensorSize&, const SensorSize&) = default;
};

/// Output of a decoder, which only appends.
struct Decoded {
  std::vector<AbsoluteEvent> events;
  std::vector<Trigger> triggers;
};

/// Thrown if the bytes are not of this format, or of an unsupported version or codec. what() is a
/// message for users.
class UnsupportedFormat : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Corruption found so far. A decoder skips it and continues at the next valid place.
struct Corruption {
  std::uint64_t places = 0;    ///< number of corrupt places
  std::uint64_t first_at = 0;  ///< byte offset of the first in the file
  std::string first;           ///< description of the first, for users
  std::uint64_t unsorted = 0;  ///< events earlier than one before them, delivered as read
  std::uint64_t outside = 0;   ///< events outside the sensor, dropped

  /// Records one more place.
  void note(std::uint64_t at, const char* what) {
    if (places++ == 0) {
      first_at = at;
      first = what;
    }
  }
};

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

/// Bytes at the end of a file that are read to find its last event; covers the disorder of events.
constexpr std::size_t tail_size = std::size_t{1} << 16;

/// Decodes one event format. Bytes are passed in pieces of any size; the split does not affect the
/// result. Memory is bounded by the size of the pieces and the format's largest unit, never by a
/// length stated in the bytes.
class Decoder {
 public:
  virtual ~Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Appends all events and triggers completed by `bytes`. Throws UnsupportedFormat.
  virtual void decode(std::span<const std::uint8_t> bytes, Decoded& out) = 0;

  /// Declares the end of the bytes: appends what is complete and reports a partial rest as
  /// corruption. Throws UnsupportedFormat if the header is incomplete.
  virtual void finish(Decoded& out) = 0;

  /// Where to restart to get every event at `t` or later, and some before. None before the header
  /// is read, and for formats that can only be read from the start. Because times wrap in many
  /// formats, seek points exist only for the part that was read; a seek past it restarts at the
  /// last one.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const {
    return seek_points_.before(t);
  }

  /// Continues at a seek point: the next bytes are those at its position. Corruption that is read
  /// again counts again.
  virtual void restart(const SeekPoint& /*seek_point*/) {}

  /// Appends the last events of the file, if they can be decoded without reading all events before.
  /// Must be called after the header was read.
  virtual void decode_tail(ByteSource& /*source*/, Decoded& /*out*/) const {}

  /// Sensor size, once the header is read or if known from elsewhere; 0x0 before.
  SensorSize size() const { return size_; }

  /// Whether columns count from the right and rows from the bottom, for whoever knows the size to
  /// turn them round.
  bool is_mirrored() const { return is_mirrored_; }

  const Corruption& corruption() const { return corruption_; }

 protected:
  Decoder() = default;

  SensorSize size_;
  bool is_mirrored_ = false;
  Corruption corruption_;
  SeekPoints seek_points_;
};

}  // namespace eventcamera
