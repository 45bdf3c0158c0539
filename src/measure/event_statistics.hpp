// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

#include "src/core/absolute_event.hpp"
#include "src/core/image.hpp"
#include "src/core/step_times.hpp"
#include "src/measure/gap_histogram.hpp"

namespace eventcamera {

/// How many events each pixel has.
using EventMap = Image<std::uint32_t>;

/// The shares of gaps whose quantiles are told.
inline constexpr std::array gap_shares = {0.05, 0.25, 0.5, 0.75, 0.95};

/// A stream in a few numbers.
struct StreamFigures {
  std::uint64_t events = 0;
  double rate = 0;       ///< events a second
  double on_share = 0;   ///< of ON among the events
  double mean = 0;       ///< over all pixels, of events per pixel and second
  double deviation = 0;  ///< the standard deviation of the same
  std::array<Microseconds, gap_shares.size()> gaps{};  ///< from a pixel's event to its next
};

/// Counts a stream. What it keeps grows with the sensor, not with the stream.
class EventStatistics {
 public:
  /// Throws std::bad_alloc.
  EventStatistics(int width, int height);

  /// An event inside the picture, not before the last one.
  void add(const AbsoluteEvent& event) {
    auto& last = last_.at(event.x, event.y());
    if (last != never) gaps_.add(event.t - last);
    last = event.t;
    ++map_.at(event.x, event.y());
    ++(event.polarity() == Polarity::on ? on_ : off_);
  }

  /// Counts from 0 again. Pixels remember their last events, so that no gap is lost.
  void restart();

  /// Time begins anew: no gap lies between what was and what comes.
  void forget_times();

  /// Where all this took `duration`.
  StreamFigures figures(Nanoseconds duration) const;

  const EventMap& map() const { return map_; }

 private:
  static constexpr Microseconds never = INT64_MIN;

  EventMap map_;
  Image<Microseconds> last_;
  GapHistogram gaps_;
  std::uint64_t on_ = 0;
  std::uint64_t off_ = 0;
};

/// Pearson's correlation of two maps of one size; 0 where one is the same everywhere.
double correlation(const EventMap& a, const EventMap& b);

}  // namespace eventcamera
