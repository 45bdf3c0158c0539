// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventcamera {

/// Queue of pieces of bytes with contiguous access: a unit within one piece is read in place, one
/// that spans pieces is copied together first. Nothing is copied before it is needed.
class ByteQueue {
 public:
  /// Adds a piece, which must stay valid until it is consumed or keep() is called.
  void push(std::span<const std::uint8_t> piece) {
    keep();
    piece_ = piece;
  }

  /// Returns the contiguous bytes at the front, at least `count`; nothing if there are fewer. Valid
  /// until the next push(), consume(), keep() or larger peek().
  std::span<const std::uint8_t> peek(std::size_t count) {
    const auto kept = kept_.size() - head_;
    if (kept == 0) return piece_.size() >= count ? piece_ : std::span<const std::uint8_t>{};
    if (kept < count) {
      append_to_kept(std::min(count - kept, piece_.size()));
      if (kept_.size() - head_ < count) return {};
    }
    return std::span<const std::uint8_t>(kept_).subspan(head_);
  }

  void consume(std::size_t count) {
    position_ += count;
    const auto from_kept = std::min(count, kept_.size() - head_);
    head_ += from_kept;
    piece_ = piece_.subspan(count - from_kept);
    const auto kept = kept_.size() - head_;
    if (kept > copied_) return;
    // The rest is also in the piece, so continue to read it there.
    piece_ = {piece_.data() - kept, piece_.size() + kept};
    kept_.clear();
    head_ = 0;
    copied_ = 0;
  }

  /// Copies the rest of the borrowed piece.
  void keep() {
    append_to_kept(piece_.size());
    piece_ = {};
    copied_ = 0;
  }

  std::size_t size() const { return kept_.size() - head_ + piece_.size(); }

  /// Offset of the front in the file.
  std::uint64_t position() const { return position_; }

  /// Drops everything; the next bytes are those at `position`.
  void restart(std::uint64_t position) {
    kept_.clear();
    head_ = 0;
    piece_ = {};
    copied_ = 0;
    position_ = position;
  }

 private:
  /// Consumed bytes at the front of kept_ from which on the rest is moved to the front.
  static constexpr std::size_t max_consumed = 4096;

  void append_to_kept(std::size_t count) {
    if (head_ >= max_consumed && head_ >= kept_.size() / 2) {
      kept_.erase(kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(head_));
      head_ = 0;
    }
    kept_.insert(kept_.end(), piece_.begin(), piece_.begin() + static_cast<std::ptrdiff_t>(count));
    piece_ = piece_.subspan(count);
    copied_ += count;
  }

  std::vector<std::uint8_t> kept_;  ///< bytes before piece_; the first head_ are consumed
  std::size_t head_ = 0;
  std::span<const std::uint8_t> piece_;
  std::size_t copied_ = 0;  ///< bytes of the current piece already copied to kept_
  std::uint64_t position_ = 0;
};

}  // namespace eventcamera
