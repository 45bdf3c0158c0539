// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/measure/stream_role.hpp"

namespace eventcamera {

/// Maximum distances in time of matching events, in increasing order.
inline constexpr std::array<Microseconds, 3> match_distances = {1'000, 5'000, 10'000};

/// Similarity of the events of two streams.
struct MatchFigures {
  /// Fraction of the events with a match within each of match_distances.
  std::array<double, match_distances.size()> shares{};
  /// Mean distance to the nearest match; events without one count as the longest of
  /// match_distances.
  double nearest_distance = 0;  ///< microseconds
};

/// Finds the match of each event: the nearest event in time of the other stream, of the same
/// polarity and at the same pixel or one of its eight neighbours. Several events may match the same
/// one.
///
/// Each pixel stores its last event of either polarity, so that earlier matches are known when an
/// event is added. An event without a close enough match waits at its pixel for a later match,
/// until that could no longer be close enough.
class EventMatcher {
 public:
  EventMatcher(int width, int height);

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one of either
  /// stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  MatchFigures figures(StreamRole role) const;

 private:
  using Number = std::uint64_t;  ///< index of a waiting event, in order of time; 0 = none
  static constexpr std::size_t max_waiting = std::size_t{1} << 23;

  struct Pixel {
    LastTime last;
    Number waiting;  ///< latest waiting event at this pixel
  };
  struct Waiting {
    Microseconds time;
    Microseconds nearest;  ///< distance to the nearest match so far
    Number before;         ///< previous waiting event at this pixel
  };
  struct Stream {
    std::array<Image<Pixel>, 2> pixels;  ///< by polarity, with a margin of one
    std::deque<Waiting> waiting;
    Number first = 1;  ///< number of the first event in `waiting`
    std::uint64_t events = 0;
    std::array<std::uint64_t, match_distances.size()> matched{};
    std::uint64_t distances = 0;  ///< sum over all events, microseconds

    void count(Microseconds distance);
    void reduce_distance(Microseconds distance, Microseconds known_distance);
  };

  static void match_waiting(Stream& stream, Pixel& pixel, Microseconds time);
  static void wait(Stream& stream, Pixel& pixel, const Waiting& waiting);

  PerRole<Stream> streams_;
};

}  // namespace eventcamera
