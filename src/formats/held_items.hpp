// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Copies of items, in order.
class HeldItems {
 public:
  void push(const Item& item) {
    std::visit([this](const auto& some) { hold(some); }, item);
  }

  /// Returns the next item, valid until the next call. After the last one, all are removed.
  std::optional<Item> next() {
    if (next_ < held_.size()) return held_[next_++].item;
    clear();
    return std::nullopt;
  }

  void clear() {
    held_.clear();
    next_ = size_ = 0;
  }

  /// Their size in memory, in bytes.
  std::size_t size() const { return size_; }

 private:
  /// An item, and the memory that it refers to.
  struct Held {
    Item item;
    std::variant<std::vector<AbsoluteEvent>, std::vector<std::uint8_t>, std::vector<Trigger>,
                 std::vector<ImuSample>>
        memory;
  };

  template <class Some>
  void hold(Some item) {
    auto& [stream, content] = item;
    std::vector copied(content.begin(), content.end());
    size_ += sizeof(Held) + content.size_bytes();
    content = copied;
    held_.push_back({item, std::move(copied)});
  }

  void hold(FrameItem item) {
    auto& frame = item.frame;
    std::vector copied(frame.pixels, frame.pixels + frame.height * frame.stride);
    size_ += sizeof(Held) + copied.size();
    frame.pixels = copied.data();
    held_.push_back({item, std::move(copied)});
  }

  std::vector<Held> held_;
  std::size_t next_ = 0;
  std::size_t size_ = 0;
};

}  // namespace eventcamera
