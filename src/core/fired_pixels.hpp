// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Bit set of the pixels that fire at one time, in raster order; expanded to events when written.
class FiredPixels {
 public:
  /// 16 pixels of row y, from x on; at least one fires.
  struct Group {
    std::uint16_t x;
    std::uint16_t y;
    std::uint16_t fired;  ///< bit i is set if pixel x + i fires
    std::uint16_t on;     ///< bit i is set if the event of pixel x + i is ON
  };

  /// Drops all pixels but keeps their memory.
  void begin(std::uint32_t t) {
    t_ = t;
    size_ = 0;
    group_count_ = 0;
  }

  /// Adds 64 pixels of row y, from x on: bit i of `fired` is set if pixel x + i fires, bit i of
  /// `on` if its event is ON. Always inlined, so that SIMD code compiles it for its own target.
  [[gnu::always_inline]] void add(int x, int y, std::uint64_t fired, std::uint64_t on) {
    size_ += static_cast<std::uint32_t>(std::popcount(fired));
    if (memory_.size() < group_count_ + 4) memory_.resize(2 * memory_.size() + 4);
    // Without branches, which would be mispredicted often.
    Group* const out = memory_.data();
    std::size_t count = group_count_;
    for (int i = 0; i < 64; i += 16) {
      const auto part = static_cast<std::uint16_t>(fired >> i);
      out[count] = {static_cast<std::uint16_t>(x + i), static_cast<std::uint16_t>(y), part,
                    static_cast<std::uint16_t>(on >> i)};
      count += part != 0 ? 1 : 0;
    }
    group_count_ = static_cast<std::uint32_t>(count);
  }

  std::uint32_t time() const { return t_; }

  std::size_t size() const { return size_; }

  /// Number of pixels whose event is ON.
  std::size_t on_size() const {
    std::size_t sum = 0;
    for (const auto& group : groups())
      sum += static_cast<std::size_t>(std::popcount(static_cast<unsigned>(group.fired & group.on)));
    return sum;
  }

  void write_to(Event* out) const;

  /// Passes the pixels of each row to visit(int y, std::span<const Group>, number of pixels).
  template <class Visit>
  void visit_rows(const Visit& visit) const {
    const auto all = groups();
    for (std::size_t first = 0; first < all.size();) {
      std::size_t last = first;
      std::size_t size = 0;
      for (; last < all.size() && all[last].y == all[first].y; ++last)
        size += static_cast<std::size_t>(std::popcount(all[last].fired));
      visit(int{all[first].y}, all.subspan(first, last - first), size);
      first = last;
    }
  }

  /// Writes the events of groups, at time `t`; `out` has their number.
  static void write(std::span<const Group> groups, std::uint32_t t, std::span<Event> out);

  /// Passes all events to visit(std::span<const Event>), in several calls.
  template <class Visit>
  void visit(const Visit& visit) const {
    constexpr std::size_t groups_at_once = 32;
    Event events[groups_at_once * 16];
    for (std::size_t first = 0; first < group_count_; first += groups_at_once) {
      const auto part = groups().subspan(first, std::min(groups_at_once, group_count_ - first));
      std::size_t count = 0;
      for (const auto& group : part) count += static_cast<std::size_t>(std::popcount(group.fired));
      write(part, t_, std::span(events).first(count));
      visit(std::span<const Event>(events, count));
    }
  }

 private:
  std::span<const Group> groups() const { return std::span(memory_).first(group_count_); }

  std::vector<Group> memory_;
  std::uint32_t group_count_ = 0;
  std::uint32_t size_ = 0;
  std::uint32_t t_ = 0;
};

}  // namespace eventcamera
