// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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
  void push(std::span<const std::uint8_t> piece);

  /// Returns the contiguous bytes at the front, at least `count`; nothing if there are fewer. Valid
  /// until the next push(), consume(), keep() or larger peek().
  std::span<const std::uint8_t> peek(std::size_t count);

  void consume(std::size_t count);

  /// Copies the rest of the borrowed piece.
  void keep();

  /// Number of bytes in the queue.
  std::size_t size() const { return kept_.size() - head_ + piece_.size(); }

  /// Offset of the front in the file.
  std::uint64_t position() const { return position_; }

  /// Drops everything; the next bytes are those at `position`.
  void restart(std::uint64_t position);

 private:
  void append_to_kept(std::size_t count);

  std::vector<std::uint8_t> kept_;  ///< bytes before piece_; the first head_ are consumed
  std::size_t head_ = 0;
  std::span<const std::uint8_t> piece_;
  std::size_t copied_ = 0;  ///< bytes of the current piece already copied to kept_
  std::uint64_t position_ = 0;
};

}  // namespace eventcamera
