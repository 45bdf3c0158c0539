// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace eventcamera {

/// The bytes of a file, wherever they come from, read at any position.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  /// The size of the file; 0 where it is not known.
  virtual std::uint64_t size() const = 0;

  /// Fills `out` from a position on, and returns how many bytes that are: fewer only at the end of
  /// the file. Nothing where they cannot be read.
  virtual std::optional<std::size_t> read(std::uint64_t position,
                                          std::span<std::uint8_t> out) noexcept = 0;

  /// The bytes from a position on, as many as are read at once, valid until the next call; none at
  /// the end of the file. Nothing where they cannot be read.
  virtual std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) = 0;

  /// Whether bytes could not be read of late.
  virtual bool failed() const noexcept { return false; }

 protected:
  ByteSource() = default;
};

/// A file in memory.
class MemoryBytes final : public ByteSource {
 public:
  explicit MemoryBytes(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {}

  std::uint64_t size() const override { return bytes_.size(); }

  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    const auto from = std::min<std::uint64_t>(position, bytes_.size());
    const auto count = std::min<std::uint64_t>(out.size(), bytes_.size() - from);
    std::ranges::copy(std::span(bytes_).subspan(from, count), out.begin());
    return count;
  }

  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override {
    constexpr std::uint64_t max_piece = std::uint64_t{1} << 18;
    const auto rest = std::span(bytes_).subspan(std::min<std::uint64_t>(position, bytes_.size()));
    return rest.first(std::min<std::uint64_t>(rest.size(), max_piece));
  }

 private:
  std::vector<std::uint8_t> bytes_;
};

}  // namespace eventcamera
