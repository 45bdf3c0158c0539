// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Cuts the events of a recording into intervals of equal length, each sorted by time and, within a
/// time, in raster order. A time is a whole microsecond, rounded down, so an interval is of those
/// from its start to before its end.
///
/// Events may come out of order by up to `settled`; later ones are dropped. So are those of a clock
/// that jumps ahead and soon comes back, as a bit that flips makes it, and the second of two events
/// of the same pixel and time.
class Chunker {
 public:
  /// Sensors' own disorder, and the time for which a clock that errs does so, are shorter.
  static constexpr Microseconds settled = 10'000;
  /// Times beyond, in either direction, are errors: 142 years.
  static constexpr Microseconds max_time = Microseconds{1} << 52;
  /// Memory is bounded: an interval that has more is cut in two.
  static constexpr std::size_t max_events = std::size_t{1} << 22;

  struct Interval {
    Microseconds start;
    Microseconds duration;
    std::span<const Event> events;  ///< none: a silence, of any length; they stay until next()
  };

  struct Dropped {
    std::uint64_t late = 0;      ///< their interval was handed out
    std::uint64_t stray = 0;     ///< of a time that was an error
    std::uint64_t repeated = 0;  ///< of the pixel and time of another
  };

  /// The first interval begins with the first event.
  explicit Chunker(Microseconds length) : length_(length) {}

  /// The first interval begins at `start`, and what is before is left out.
  Chunker(Microseconds length, Microseconds start);

  void push(std::span<const AbsoluteEvent> events);

  /// Says that nothing earlier than `t` will come any more.
  void reach(Microseconds t);

  /// Says that nothing will come any more.
  void finish();

  /// The next interval, if nothing more can come that belongs to it.
  std::optional<Interval> next();

  /// When the first interval begins; nothing while that is not known.
  std::optional<Microseconds> first() const { return first_; }

  /// The time of the latest event; only where first() is known.
  Microseconds latest() const { return latest_; }

  const Dropped& dropped() const { return dropped_; }

 private:
  static constexpr Microseconds never = std::numeric_limits<Microseconds>::min();
  static constexpr std::size_t max_ahead = std::size_t{1} << 16;

  void place(const AbsoluteEvent& event);
  void keep(const AbsoluteEvent& event);
  void believe_ahead();
  void sort();
  Interval hand_out(Microseconds end);
  Microseconds grid_before(Microseconds t) const { return t - (t - *first_) % length_; }

  Microseconds length_;
  std::optional<Microseconds> first_;
  bool given_start_ = false;
  Microseconds start_ = never;    ///< of the next interval, once first_ is known
  Microseconds latest_ = never;   ///< of what is kept
  Microseconds reached_ = never;  ///< nothing earlier will come
  bool finished_ = false;

  std::vector<AbsoluteEvent> kept_;  ///< its first head_ are handed out
  std::size_t head_ = 0;
  bool sorted_ = true;
  std::vector<AbsoluteEvent> ahead_;  ///< far ahead of latest_: not yet believed
  std::vector<Event> handed_out_;
  Dropped dropped_;
};

}  // namespace eventcamera
