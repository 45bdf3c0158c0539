// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Bytes that overwrite what was written at a position of the file.
struct FilePatch {
  std::uint64_t position;
  std::vector<std::uint8_t> bytes;
};

/// Writes one event format. Events come sorted by time and within the sensor, in pieces of any
/// size: how they are split changes nothing in what a reader makes of the file.
class Encoder {
 public:
  virtual ~Encoder() = default;
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  /// Appends the bytes of `events` to `out`, the header before the first.
  virtual void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) = 0;

  /// Appends what ends the file; the header, too, where nothing was encoded.
  virtual void finish(std::vector<std::uint8_t>& out) = 0;

  /// What to write into the header after finish(), where the file can be seeked in. Our readers do
  /// without it.
  virtual std::optional<FilePatch> patch() const { return std::nullopt; }

 protected:
  Encoder() = default;
};

}  // namespace eventcamera
