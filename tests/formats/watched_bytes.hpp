// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// File that is read in small pieces, and tells how far.
class WatchedBytes final : public ByteSource {
 public:
  explicit WatchedBytes(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {}

  std::uint64_t size() const override { return bytes_.size(); }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    return bytes_.read(position, out);
  }
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override {
    const auto piece =
        bytes_.piece(position)->first(std::min<std::uint64_t>(size() - position, 4096));
    end = std::max(end, position + piece.size());
    return piece;
  }

  std::uint64_t end = 0;

 private:
  MemoryBytes bytes_;
};

}  // namespace eventcamera
