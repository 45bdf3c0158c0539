// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// A file that lies in memory.
class MemoryBytes final : public ByteSource {
 public:
  explicit MemoryBytes(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {}

  std::uint64_t size() const override { return bytes_.size(); }

  bool read(std::uint64_t position, std::span<std::uint8_t> out) noexcept override {
    if (position > bytes_.size() || out.size() > bytes_.size() - position) return false;
    std::ranges::copy(std::span(bytes_).subspan(position, out.size()), out.begin());
    return true;
  }

 private:
  std::vector<std::uint8_t> bytes_;
};

}  // namespace eventcamera
