// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>

#include "src/core/absolute_event.hpp"
#include "src/core/image.hpp"
#include "src/measure/side.hpp"

namespace eventcamera {

/// How far apart in time partners may be, from near to far.
inline constexpr std::array<Microseconds, 3> partner_distances = {1'000, 5'000, 10'000};

/// How many events have a partner within each of partner_distances.
using PartnerCounts = std::array<std::uint64_t, partner_distances.size()>;

/// Counts the events of each side that have a partner: an event of the other side with the same
/// polarity, at the same pixel or one of the eight around it, not too far away in time. Many may
/// have the same partner.
///
/// What came before an event is known when it comes: each pixel remembers its last event of either
/// polarity. For what comes after it, an event without a near enough partner waits at its pixel
/// until one comes, or can come no more.
class PartnerSearch {
 public:
  /// Throws std::bad_alloc, as does add().
  PartnerSearch(int width, int height);

  /// An event inside the picture, not before the last one of either side.
  void add(Side side, const AbsoluteEvent& event);

  /// Of the events so far, by what has come so far.
  const PartnerCounts& partnered(Side side) const { return lanes_[side].partnered; }

 private:
  using Ticket = std::uint64_t;  ///< of those that wait, in the order of time; 0 = nobody
  static constexpr std::size_t max_waiting = std::size_t{1} << 23;

  struct Pixel {
    Microseconds last;  ///< event
    Ticket waiting;     ///< the last one to wait here
  };
  struct Waiting {
    Microseconds time;
    Microseconds nearest;  ///< how far away the nearest partner is
    Ticket before;         ///< who waits at the same pixel
  };
  struct Lane {
    std::array<Image<Pixel>, 2> pixels;  ///< by polarity, with a margin of one
    std::deque<Waiting> waiting;
    Ticket first = 1;  ///< in `waiting`
    PartnerCounts partnered{};
  };

  static void count(Lane& lane, Microseconds distance, Microseconds known_distance);
  /// All that wait at a pixel have found a partner.
  static void meet(Lane& lane, Pixel& pixel, Microseconds time);
  static void wait(Lane& lane, Pixel& pixel, const Waiting& waiting);

  OfSides<Lane> lanes_;
};

}  // namespace eventcamera
