// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

namespace eventcamera {

/// The bytes of a file, wherever they come from, read at any place.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  virtual std::uint64_t size() const = 0;

  /// Fills `out` from a position on, all of it within size(). False where that cannot be.
  virtual bool read(std::uint64_t position, std::span<std::uint8_t> out) noexcept = 0;

 protected:
  ByteSource() = default;
};

}  // namespace eventcamera
