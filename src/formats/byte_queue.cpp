// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/byte_queue.hpp"

#include <algorithm>

namespace eventcamera {

namespace {

/// Consumed bytes at the front of kept_ from which on the rest is moved to the front.
constexpr std::size_t max_consumed = 4096;

}  // namespace

void ByteQueue::push(std::span<const std::uint8_t> piece) {
  keep();
  piece_ = piece;
}

std::span<const std::uint8_t> ByteQueue::peek(std::size_t count) {
  const auto kept = kept_.size() - head_;
  if (kept == 0) return piece_.size() >= count ? piece_ : std::span<const std::uint8_t>{};
  if (kept < count) {
    append_to_kept(std::min(count - kept, piece_.size()));
    if (kept_.size() - head_ < count) return {};
  }
  return std::span<const std::uint8_t>(kept_).subspan(head_);
}

void ByteQueue::consume(std::size_t count) {
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

void ByteQueue::keep() {
  append_to_kept(piece_.size());
  piece_ = {};
  copied_ = 0;
}

void ByteQueue::restart(std::uint64_t position) {
  kept_.clear();
  head_ = 0;
  piece_ = {};
  copied_ = 0;
  position_ = position;
}

void ByteQueue::append_to_kept(std::size_t count) {
  if (head_ >= max_consumed && head_ >= kept_.size() / 2) {
    kept_.erase(kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(head_));
    head_ = 0;
  }
  kept_.insert(kept_.end(), piece_.begin(), piece_.begin() + static_cast<std::ptrdiff_t>(count));
  piece_ = piece_.subspan(count);
  copied_ += count;
}

}  // namespace eventcamera
