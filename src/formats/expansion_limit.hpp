// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace eventcamera {

/// Limits the decompressed size of a file, because a few kilobytes of zeros would take minutes: to
/// 256 MiB plus `max_ratio` times the compressed size.
class ExpansionLimit {
 public:
  explicit ExpansionLimit(std::uint64_t max_ratio = of_pictures) : max_ratio_(max_ratio) {}

  /// Maximum size of the content of the next `compressed` bytes, at most `limit`.
  std::size_t of(std::size_t compressed, std::size_t limit) {
    allowed_ += max_ratio_ * compressed;
    return static_cast<std::size_t>(std::min<std::uint64_t>(limit, allowed_));
  }

  /// Counts bytes that were decompressed.
  void count(std::size_t bytes) { allowed_ -= std::min<std::uint64_t>(bytes, allowed_); }

 private:
  /// Camera frames reach a ratio of 100. Black ones reach 13,000, and use up the 256 MiB in a few
  /// hundred frames.
  static constexpr std::uint64_t of_pictures = 2048;

  std::uint64_t max_ratio_;
  std::uint64_t allowed_ = std::uint64_t{1} << 28;
};

}  // namespace eventcamera
