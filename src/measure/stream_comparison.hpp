// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "src/core/absolute_event.hpp"
#include "src/core/arrivals.hpp"
#include "src/core/event.hpp"
#include "src/core/step_times.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/measure/partner_search.hpp"
#include "src/measure/rate_curve.hpp"
#include "src/measure/side.hpp"

namespace eventcamera {

/// How alike two streams are.
struct ComparisonFigures {
  Nanoseconds start = 0;  ///< of the time that both streams cover
  Nanoseconds end = 0;
  OfSides<StreamFigures> streams;
  double map_correlation = 0;  ///< of the events of each pixel
  /// Of the events of each side, those that have a partner on the other.
  OfSides<std::array<double, partner_distances.size()>> partner_shares;
};

/// Compares two streams of one sensor over the time that both cover.
class StreamComparison {
 public:
  /// Throws std::bad_alloc, as does add().
  StreamComparison(int width, int height);

  /// The side that is known less far: whose events must come next.
  Side behind() const;

  /// Takes the sorted events of (start, end] of one side, which count their times from `start`.
  /// Returns how many were left out since they lie outside the picture.
  std::size_t add(Side side, std::span<const Event> events, Nanoseconds start, Nanoseconds end);

  ComparisonFigures figures() const;
  const EventMap& map(Side side) const { return statistics_[side].map(); }
  const RateCurve& rates() const { return rates_; }

 private:
  struct Arriving {
    Arrivals arrivals;
    std::vector<AbsoluteEvent> waiting{};  ///< for the other side
    std::size_t taken = 0;                 ///< of those, the first ones
    std::optional<Nanoseconds> start{};
    Nanoseconds end = 0;
  };

  /// What both sides cover, where they do.
  std::optional<Nanoseconds> start() const;
  Nanoseconds end() const;
  /// Takes the waiting events up to `end`, of both sides in the order of time.
  void take_until(Microseconds end);

  OfSides<Arriving> arriving_;
  OfSides<EventStatistics> statistics_;
  PartnerSearch partners_;
  RateCurve rates_;
  bool begun_ = false;
};

}  // namespace eventcamera
