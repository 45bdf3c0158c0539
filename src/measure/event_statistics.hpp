// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Time of the last event of a pixel, or none, which is earlier than any time. None is all zeros,
/// so the memory of pixels without events is never written.
class LastTime {
 public:
  constexpr LastTime() = default;
  constexpr LastTime(Microseconds t) : bits_(static_cast<std::uint64_t>(t) ^ sign) {}

  constexpr bool is_known() const { return bits_ != 0; }
  constexpr Microseconds value() const { return static_cast<Microseconds>(bits_ ^ sign); }

  friend constexpr bool operator==(LastTime a, LastTime b) { return a.bits_ == b.bits_; }
  friend constexpr bool operator<(LastTime a, LastTime b) { return a.bits_ < b.bits_; }

 private:
  static constexpr std::uint64_t sign = std::uint64_t{1} << 63;

  std::uint64_t bits_ = 0;
};

/// Number of events per pixel.
using EventMap = Image<std::uint32_t>;

/// Quantiles of the inter-event intervals that are measured.
inline constexpr std::array interval_shares = {0.05, 0.25, 0.5, 0.75, 0.95};

/// Summary statistics of a stream.
struct StreamFigures {
  std::uint64_t events = 0;
  double rate = 0;            ///< events per second
  double on_share = 0;        ///< fraction of ON events
  double active_share = 0;    ///< fraction of pixels with events
  double distinct_share = 0;  ///< distinct times per event; 1 if all differ
  double mean = 0;            ///< over all pixels, events per pixel and second
  double std_dev = 0;         ///< over all pixels, events per pixel and second
  /// Quantiles (interval_shares) of the time between successive events of a pixel.
  std::array<Microseconds, interval_shares.size()> intervals{};
};

/// Histogram of interval lengths with logarithmic bins: exact up to 63 microseconds, accurate to
/// 1/32 beyond.
class IntervalHistogram {
 public:
  /// Adds an interval, which must not be negative.
  void add(Microseconds interval) {
    ++bins_[bin_of(static_cast<std::uint64_t>(interval))];
    ++count_;
  }

  /// Returns the `share` quantile, `share` in [0, 1], as the middle of its bin; 0 without
  /// intervals.
  Microseconds quantile(double share) const;

  /// Wasserstein distance to the logarithms of other intervals, in decades: how far the intervals
  /// of one must be moved on average to become the other's. 0 if either has none. Intervals of 0
  /// count as half a microsecond.
  double distance_to(const IntervalHistogram& other) const;

 private:
  static constexpr unsigned step_bits = 5;  ///< log2 of the bins per octave
  static constexpr std::uint64_t steps = 1U << step_bits;
  static constexpr std::uint64_t exact = 2 * steps;  ///< shorter intervals have a bin each

  static constexpr std::size_t bin_of(std::uint64_t interval) {
    if (interval < exact) return interval;
    const auto shift = static_cast<unsigned>(std::bit_width(interval)) - step_bits - 1;
    return steps * shift + (interval >> shift);
  }
  static constexpr Microseconds middle_of(std::size_t bin) {
    if (bin < exact) return static_cast<Microseconds>(bin);
    const auto shift = static_cast<unsigned>(bin / steps) - 1;
    const std::uint64_t first = (bin - steps * shift) << shift;
    return static_cast<Microseconds>(first + (std::uint64_t{1} << shift) / 2);
  }
  static constexpr std::size_t bin_count =
      steps * (63 - step_bits - 1) + exact;  ///< for intervals of up to 63 bits

  std::array<std::uint64_t, bin_count> bins_{};
  std::uint64_t count_ = 0;
};

class LastTimes {
 public:
  LastTimes(int width, int height) : last_(width, height) {}

  /// Records an event, which must lie inside the sensor and not be earlier than the last one.
  /// Returns the time since the last event of its pixel, if any.
  std::optional<Microseconds> update(const AbsoluteEvent& event) {
    const auto last = std::exchange(last_.at(event.x, event.y()), event.t);
    return last.is_known() ? std::optional(event.t - last.value()) : std::nullopt;
  }

  /// Forgets all times, so that no interval spans a discontinuity.
  void forget() { last_ = {last_.width(), last_.height()}; }

 private:
  Image<LastTime> last_;
};

/// Collects statistics of a stream. Memory depends on the sensor size, not on the length of the
/// stream.
class EventStatistics {
 public:
  EventStatistics(int width, int height) : map_(width, height) {}

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one, and the
  /// time since the last event of its pixel, if any.
  void add(const AbsoluteEvent& event, std::optional<Microseconds> interval) {
    if (interval) intervals_.add(*interval);
    const auto before = map_.at(event.x, event.y())++;
    squares_ += 2 * std::uint64_t{before} + 1;
    active_ += before == 0 ? 1 : 0;
    distinct_ += last_ == event.t ? 0 : 1;
    last_ = event.t;
    ++(event.polarity() == Polarity::on ? on_ : off_);
  }

  void restart() { *this = {map_.width(), map_.height()}; }

  /// Returns the statistics since the last restart(), `duration` ago.
  StreamFigures figures(Nanoseconds duration) const;

  const EventMap& map() const { return map_; }
  const IntervalHistogram& intervals() const { return intervals_; }

 private:
  EventMap map_;
  IntervalHistogram intervals_;
  std::uint64_t squares_ = 0;   ///< sum of the squared events of each pixel
  std::uint64_t active_ = 0;    ///< pixels with events
  std::uint64_t distinct_ = 0;  ///< times
  LastTime last_;
  std::uint64_t on_ = 0;
  std::uint64_t off_ = 0;
};

/// Pearson correlation of two maps of the same size; 0 if one is constant.
double correlation(const EventMap& a, const EventMap& b);

}  // namespace eventcamera
