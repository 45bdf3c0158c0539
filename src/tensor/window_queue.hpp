// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"

namespace eventcamera {

/// Length of windows, by count if `events` > 0, else by time if `duration` > 0, else in intervals.
struct WindowSettings {
  std::size_t events = 0;  ///< at most WindowQueue::max_events
  Nanoseconds duration = 0;
  std::size_t intervals = 1;  ///< of the source: buffers, such as the intervals between frames
  double overlap = 0;         ///< share of a window that the next one repeats, below 1

  /// Start of the next window relative to one of this length; at least 1.
  template <class Length>
  Length hop(Length length) const {
    const auto repeated = static_cast<Length>(static_cast<double>(length) * overlap);
    return repeated < length ? length - repeated : 1;
  }
};

/// Cuts a stream into windows, which may overlap.
///
/// A window by time holds the events with start <= t < end, both rounded down to microseconds; the
/// first one begins with the first interval. A window by count lasts from its first to its last
/// event. A window of intervals holds the events that came with them.
class WindowQueue {
 public:
  /// Maximum number of events in a window; bounds the memory.
  static constexpr std::size_t max_events = std::size_t{1} << 24;

  struct Window {
    Nanoseconds start;
    Nanoseconds end;
    std::span<const AbsoluteEvent> events;  ///< valid until add() or reset()
  };

  struct Added {
    InvalidEvents invalid{};           ///< dropped
    std::size_t excess = 0;            ///< dropped: more than max_events in a window
    std::span<const Event> waiting{};  ///< to be added in another call
  };

  WindowQueue(int width, int height, const WindowSettings& settings)
      : settings_(settings), validator_(width, height) {}

  /// Adds an interval, and its events in [start, end]; their times are relative to `base`. Late
  /// events get the time of the end of the last window or, if windows consist of intervals, of the
  /// last interval. Then call next() until there is no more window, and add the waiting events, if
  /// any, again.
  Added add(std::span<const Event> events, Microseconds base, Nanoseconds start, Nanoseconds end);

  /// Returns the next window if it is complete.
  std::optional<Window> next();

  /// Returns the last, shorter window if it has an event that was in no other.
  std::optional<Window> finish();

  /// True if an incomplete window has started.
  bool is_open() const;

  /// End of the last interval; nothing before the first.
  std::optional<Nanoseconds> reached() const { return reached_; }

  void reset();

 private:
  struct Interval {
    Nanoseconds start;
    Nanoseconds end;
    std::size_t last;  ///< past its last event
  };

  bool of_intervals() const { return settings_.events == 0 && settings_.duration == 0; }
  void drop_returned();
  std::size_t index_at(Nanoseconds time) const;
  std::optional<Window> next_by_time();
  std::optional<Window> next_by_count();
  std::optional<Window> next_by_intervals();
  Window window(Nanoseconds start, Nanoseconds end, std::size_t last);

  WindowSettings settings_;
  EventValidator validator_;
  std::vector<AbsoluteEvent> events_;
  std::size_t first_ = 0;             ///< of the events in the next window
  std::size_t returned_ = 0;          ///< past the last event that was in a window
  std::optional<Nanoseconds> start_;  ///< of the next window by time, or of the last interval
  std::optional<Nanoseconds> reached_;
  std::deque<Interval> intervals_;  ///< of the next window of intervals
};

}  // namespace eventcamera
