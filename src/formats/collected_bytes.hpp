// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

/// Collects the pushed bytes of a file that needs random access.
class CollectedBytes {
 public:
  /// `what` names the file in errors, such as "a NumPy archive".
  explicit CollectedBytes(std::string what) : what_(std::move(what)) {}

  /// Throws UnsupportedFormat if the file is too large.
  void push(std::span<const std::uint8_t> piece) {
    if (piece.size() > max_size - bytes_.size())
      throw UnsupportedFormat(what_ + " this large has to be pulled, as from filesrc");
    bytes_.insert(bytes_.end(), piece.begin(), piece.end());
  }

  /// Returns the whole file; the next piece begins another.
  std::unique_ptr<ByteSource> take() {
    return std::make_unique<MemoryBytes>(std::exchange(bytes_, {}));
  }

 private:
  static constexpr std::size_t max_size = std::size_t{1} << 28;

  std::string what_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace eventcamera
