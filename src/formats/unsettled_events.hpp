// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/label.hpp"

namespace eventcamera {

/// Events at the start of a file or after a jump of the clock, until later ones show which times
/// are right.
///
/// Times that go on for `settled` are right; so are single ones far apart, if they rise. Times that
/// the following events do not continue are stray: of one event, after a flipped bit, or of a few.
class UnsettledEvents {
 public:
  /// Longer than the disorder of sensors, and than a clock stays wrong after a flipped bit.
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

  /// The times before all of these go on, so these are stray.
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

}  // namespace eventcamera
