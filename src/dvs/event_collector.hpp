// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_buckets.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

class EventOrder;

/// Takes the events of one band of rows, in any order of time.
class EventCollector {
 public:
  EventCollector(EventOrder& order, int band) : order_(order), band_(band) {}

  /// `t` microseconds after the start of the interval; if that lies behind its end, the event is
  /// one of the next interval.
  void add(double t, int x, int y, Polarity polarity);

 private:
  EventOrder& order_;
  int band_;
};

/// Puts the events of an interval in order: by time, and within a microsecond in raster order.
class EventOrder {
 public:
  /// Begins an interval of `duration` microseconds, with what the last one left to it.
  void begin(double duration, int bands);
  /// Forgets what is left to the next interval.
  void reset() { late_.clear(); }

  /// Fills `events`, in buckets for consecutive stretches of time.
  void finish(EventBuckets& events, ThreadPool& threads);

 private:
  friend class EventCollector;

  /// An event that lies behind the end of its interval.
  struct LateEvent {
    double t;
    Event event;
  };
  struct alignas(64) Late : std::vector<LateEvent> {};
  struct alignas(64) Counts : std::vector<std::uint32_t> {};

  void sort_stretch(int stretch, std::vector<std::uint32_t>& counts, std::vector<Event>& out);

  double duration_ = 0;
  int shift_ = 0;  ///< a stretch has 2^shift_ microseconds
  int stretches_ = 1;
  EventBuckets collected_;      ///< stretch by stretch, band by band
  std::vector<Late> late_;      ///< band by band
  std::vector<Counts> counts_;  ///< thread by thread
};

inline void EventCollector::add(double t, int x, int y, Polarity polarity) {
  if (t > order_.duration_) {
    order_.late_[static_cast<std::size_t>(band_)].push_back({t, Event::at(x, y, 0, polarity)});
    return;
  }
  const auto microseconds = static_cast<std::uint32_t>(t);
  order_.collected_.bucket(static_cast<int>(microseconds >> order_.shift_) + 1, band_)
      .push_back(Event::at(x, y, microseconds, polarity));
}

}  // namespace eventcamera
