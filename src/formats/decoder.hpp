// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/core/absolute_event.hpp"

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

  /// The sensor's size, once its header is read or it is known from elsewhere; 0x0 before.
  SensorSize size() const { return size_; }

  const Corruption& corruption() const { return corruption_; }

 protected:
  Decoder() = default;

  SensorSize size_;
  Corruption corruption_;
};

}  // namespace eventcamera
