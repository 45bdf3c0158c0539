// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "src/core/label.hpp"

namespace eventcamera {

/// Events at the start of a file or after a jump of the clock, until later ones show which times
/// are right.
///
/// Times that continue for `settled` are right; so are single, increasing ones far apart. Times
/// that the following events do not continue are stray: of one event, after a flipped bit, or of a
/// few.
class UnsettledEvents {
 public:
  /// Exceeds the disorder of sensors, and the time that a clock stays wrong after a flipped bit.
  static constexpr Microseconds settled = 10'000;

  bool empty() const { return first_.empty(); }

  /// True if `t` is near the time of an event among these.
  bool is_near(Microseconds t) const { return is_near(t, first_) || is_near(t, second_); }

  /// Adds an event. Returns the events known to be right by now, valid until the next call. A
  /// single event at the start of a file, long before many others, is stray.
  std::span<const AbsoluteEvent> push(const AbsoluteEvent& event, bool is_start);

  /// Declares that nothing earlier than `t` will follow. Returns as push().
  std::span<const AbsoluteEvent> settle_before(Microseconds t);

  /// Declares the end of the events. Returns as push().
  std::span<const AbsoluteEvent> finish();

  /// Drops all of these as stray, because the earlier times continue.
  void drop();

  /// Number of stray events.
  std::uint64_t stray() const { return stray_; }

 private:
  using Events = std::vector<AbsoluteEvent>;

  static bool is_near(Microseconds t, const Events& events);
  static bool is_long(const Events& events);
  void settle(Events& events);
  void drop(Events& events);

  Events first_;   ///< a run of events close in time
  Events second_;  ///< another, if the clock jumped in either direction
  Events right_;   ///< returned
  std::uint64_t stray_ = 0;
};

/// Cuts the events of a recording into intervals of equal length, each sorted by time. Events
/// with the same time keep the order in which they came. Times are whole microseconds, rounded
/// down, so an interval includes its start and excludes its end.
///
/// Events may be out of order by up to `settled`. Later ones are dropped if their interval is over;
/// so are events whose times the following ones do not continue, as after a flipped bit. Neither
/// depends on how the events are divided between calls.
class Chunker {
 public:
  static constexpr Microseconds settled = UnsettledEvents::settled;
  /// Times beyond this, in either direction, are errors: 142 years.
  static constexpr Microseconds max_time = Microseconds{1} << 52;
  static constexpr bool is_time(Microseconds t) { return t >= -max_time && t <= max_time; }
  /// Bounds the memory: an interval with more events is cut in two.
  static constexpr std::size_t max_events = std::size_t{1} << 21;

  struct Interval {
    Microseconds start;
    Microseconds duration;  ///< 0 if it has a single time, of which more events may follow
    /// Sorted, timed from the start; valid until next(). None: a silence of any length.
    std::span<const Event> events;
    std::span<const Label> labels;  ///< as many as events, or none
  };

  struct Dropped {
    std::uint64_t late = 0;   ///< their interval was over
    std::uint64_t stray = 0;  ///< with an erroneous time
  };

  /// Evidence that the events are not sorted by time.
  struct Disorder {
    std::uint64_t row;  ///< number of the first event that showed it, counted from 1
    std::uint64_t dropped;
    std::uint64_t rows;
  };

  /// The first interval begins at the first event.
  explicit Chunker(Microseconds length) : length_(length) {}

  /// The first interval begins at `start`. Earlier events are ignored, and counted as late if they
  /// precede `origin`.
  Chunker(Microseconds length, Microseconds start, Microseconds origin);

  /// Returns the labels of the next events with them, if `kept`.
  void keep_labels(bool kept) { keeps_labels_ = kept; }

  /// Ends a pause.
  void push(std::span<const AbsoluteEvent> events);

  /// Declares that nothing earlier than `t` will follow.
  void advance_to(Microseconds t);

  /// Declares a pause up to `t`: waiting events are returned. Earlier ones may still follow.
  void pause(Microseconds t);

  /// Declares the end of the events.
  void finish();

  /// Returns the next interval if it is complete.
  std::optional<Interval> next();

  /// Exchanges the memory of the events that next() returned last, where they stay valid, for
  /// other memory.
  void swap_memory(std::vector<Event>& memory) { returned_.swap(memory); }

  /// Start of the first interval; nothing if not known yet.
  std::optional<Microseconds> first() const { return first_; }

  /// Time of the latest event; valid only if first() is known.
  Microseconds latest() const { return latest_; }

  Dropped dropped() const { return {late_, stray_ + unsettled_.stray()}; }

  /// Set if more than one event in a hundred was dropped, once finished or after a hundred drops.
  std::optional<Disorder> disorder() const;

 private:
  static constexpr Microseconds never = std::numeric_limits<Microseconds>::min();
  static constexpr std::size_t max_spare = 2 * max_events;

  /// Events of an interval of the grid, or of its rest.
  struct Cell {
    Microseconds start;         ///< its events count from here
    Microseconds end;           ///< on the grid
    std::vector<Event> events;  ///< in the order in which they came
    std::vector<Label> labels;  ///< of the events, if they have any
    bool is_sorted = true;
  };

  std::size_t keep_sorted(std::span<const AbsoluteEvent> events);
  void place(const AbsoluteEvent& event);
  void drop_early(const AbsoluteEvent& event);
  void note_dropped();
  Microseconds due() const;
  void keep(const AbsoluteEvent& event);
  void keep_all(std::span<const AbsoluteEvent> events);
  Cell& cell_of(Microseconds t);
  Microseconds middle();
  static void sort(Cell& cell);
  Interval interval_until(Microseconds end);
  Interval part_of(std::size_t count);
  void return_first(std::size_t count);
  Microseconds grid_before(Microseconds t) const { return t - (t - *first_) % length_; }

  Microseconds length_;
  std::optional<Microseconds> first_;
  std::optional<Microseconds> origin_;  ///< if the start is given
  bool keeps_labels_ = false;
  Microseconds start_ = never;    ///< start of the next interval, once first_ is known
  Microseconds latest_ = never;   ///< latest time of kept events
  Microseconds reached_ = never;  ///< nothing earlier will follow
  bool paused_ = false;
  bool finished_ = false;

  std::deque<Cell> cells_;       ///< those with events, in order of time
  std::size_t waiting_ = 0;      ///< events in them
  std::vector<Event> returned_;  ///< by the last next()
  std::vector<Label> returned_labels_;
  std::vector<std::vector<Event>> spare_;  ///< memory for further cells
  std::size_t spare_capacity_ = 0;         ///< sum of their capacities
  UnsettledEvents unsettled_;              ///< not kept yet
  std::uint64_t late_ = 0;
  std::uint64_t stray_ = 0;
  std::uint64_t rows_ = 0;  ///< events pushed
  std::uint64_t first_dropped_ = 0;
  std::optional<Disorder> disorder_;
};

}  // namespace eventcamera
