// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/formats/corruption.hpp"

namespace eventcamera {

/// Random access to the bytes of a file from any source.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  /// Size of the file; 0 if unknown.
  virtual std::uint64_t size() const = 0;

  /// Reads bytes at `position` into `out` and returns their number, which is smaller only at the
  /// end of the file. Nothing if reading fails.
  virtual std::optional<std::size_t> read(std::uint64_t position,
                                          std::span<std::uint8_t> out) noexcept = 0;

  /// Returns bytes at `position`, as many as are read at once, valid until the next call; empty at
  /// the end of the file. Nothing if reading fails.
  virtual std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) = 0;

  /// True if the last read failed.
  virtual bool failed() const noexcept { return false; }

 protected:
  ByteSource() = default;
};

/// File in memory.
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

  /// Returns the whole file, and starts another.
  std::unique_ptr<ByteSource> finish() {
    return std::make_unique<MemoryBytes>(std::exchange(bytes_, {}));
  }

 private:
  static constexpr std::size_t max_size = std::size_t{1} << 28;

  std::string what_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace eventcamera
