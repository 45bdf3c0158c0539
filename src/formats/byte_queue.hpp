// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventcamera {

/// Bytes that come in pieces, seen as one stretch: a unit that lies whole in a piece is read where
/// it lies, one that a cut goes through is put together first. Nothing is copied ahead of need.
class ByteQueue {
 public:
  /// Adds a piece. It is only borrowed: it has to stay until it is consumed, or keep() is called.
  void push(std::span<const std::uint8_t> piece);

  /// At least `count` bytes from the front, as many as lie together; nothing where there are fewer.
  /// They stay where they are until the next push(), consume(), keep() or greater peek().
  std::span<const std::uint8_t> peek(std::size_t count);

  void consume(std::size_t count);

  /// Copies what is left of the borrowed piece.
  void keep();

  /// How many bytes there are.
  std::size_t size() const { return kept_.size() - head_ + piece_.size(); }

  /// The front's position in the file.
  std::uint64_t position() const { return position_; }

  /// Drops everything; what comes next lies at `position`.
  void restart(std::uint64_t position);

 private:
  void append_to_kept(std::size_t count);

  std::vector<std::uint8_t> kept_;  ///< before piece_; its first head_ bytes are consumed
  std::size_t head_ = 0;
  std::span<const std::uint8_t> piece_;
  std::size_t copied_ = 0;  ///< bytes of the piece, before piece_, that are in kept_ by now
  std::uint64_t position_ = 0;
};

}  // namespace eventcamera
