// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Queue of events: a ring buffer that grows up to `max_size`.
class RecentEvents {
 public:
  static constexpr std::size_t max_size = std::size_t{1} << 23;

  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == max_size; }
  std::size_t size() const { return size_; }
  const AbsoluteEvent& front() const { return ring_[first_]; }

  /// Must not be full().
  void push(const AbsoluteEvent& event) {
    if (size_ == ring_.size()) grow();
    ring_[(first_ + size_) & (ring_.size() - 1)] = event;
    ++size_;
  }

  void pop() {
    first_ = (first_ + 1) & (ring_.size() - 1);
    --size_;
  }

 private:
  /// Capacities are powers of two, so that indices wrap with a mask.
  void grow() {
    std::vector<AbsoluteEvent> larger(ring_.empty() ? 1024 : 2 * ring_.size());
    for (std::size_t i = 0; i < size_; ++i) larger[i] = ring_[(first_ + i) & (ring_.size() - 1)];
    ring_.swap(larger);
    first_ = 0;
  }

  std::vector<AbsoluteEvent> ring_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

/// Limits of a window besides its length in time; 0 = no limit.
struct WindowLimits {
  std::size_t events = 0;       ///< in the window
  std::size_t area_events = 0;  ///< in each area
  int area_side = 16;           ///< side of the square areas, pixels

  friend bool operator==(const WindowLimits&, const WindowLimits&) = default;
};

/// Sliding window of the latest events, with counts per pixel. Windows of successive pictures may
/// overlap at no extra cost: an event is processed only when it enters and when it leaves.
class EventWindow {
 public:
  struct Counts {
    std::uint32_t on = 0;
    std::uint32_t off = 0;
  };

  EventWindow(int width, int height, const WindowLimits& limits);

  /// Adds an event, which must lie inside the picture and not be earlier than the last one, and
  /// drops the oldest events beyond the limits.
  void add(const AbsoluteEvent& event);

  /// Drops the events before `time`.
  void begin_at(Microseconds time);

  const Counts* row(int y) const { return counts_.row(y); }

 private:
  void drop_oldest();
  std::size_t& area_of(const AbsoluteEvent& event);

  WindowLimits limits_;
  RecentEvents events_;
  Image<Counts> counts_;
  int areas_across_;
  std::vector<std::size_t> areas_;  ///< number of events per area; empty if not limited
};

/// Polarities that a pixel has: bit 0 OFF, bit 1 ON.
constexpr std::uint8_t kind_of(const EventWindow::Counts& counts) {
  return static_cast<std::uint8_t>((counts.off > 0 ? 1 : 0) + (counts.on > 0 ? 2 : 0));
}

}  // namespace eventcamera
