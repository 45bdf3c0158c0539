// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/render/recent_events.hpp"

namespace eventcamera {

/// What a window holds at most, besides its length in time; 0 = no such limit.
struct WindowLimits {
  std::size_t events = 0;       ///< in all
  std::size_t area_events = 0;  ///< in any one area
  int area_side = 16;           ///< areas are squares of so many pixels

  friend bool operator==(const WindowLimits&, const WindowLimits&) = default;
};

/// The latest events, and how many of them each pixel has. Windows that follow each other may
/// overlap: an event is counted when it comes and again when it leaves, however many pictures there
/// are in between.
class EventWindow {
 public:
  struct Counts {
    std::uint32_t on = 0;
    std::uint32_t off = 0;
  };

  EventWindow(int width, int height, const WindowLimits& limits);

  /// Takes an event, which must lie inside the picture and not before the last one, and lets the
  /// oldest go that the limits no longer allow.
  void add(const AbsoluteEvent& event);

  /// Lets events go that are not later than this.
  void begin_after(Microseconds time);

  const Counts* row(int y) const { return counts_.row(y); }

 private:
  void drop_oldest();
  std::size_t& area_of(const AbsoluteEvent& event);

  WindowLimits limits_;
  RecentEvents events_;
  Image<Counts> counts_;
  int areas_across_;
  std::vector<std::size_t> areas_;  ///< events in each, where they are limited
};

/// Which polarities a pixel has, as PixelKinds numbers them: bit 0 OFF, bit 1 ON.
constexpr std::uint8_t kind_of(const EventWindow::Counts& counts) {
  return static_cast<std::uint8_t>((counts.off > 0 ? 1 : 0) + (counts.on > 0 ? 2 : 0));
}

}  // namespace eventcamera
