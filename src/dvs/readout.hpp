// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/event_buckets.hpp"

namespace eventcamera {

/// Sorts the events of an interval, which bands of rows add in any order, by time, then in raster
/// order.
class EventSorter {
 public:
  /// Begins an interval of `duration` microseconds with the deferred events of the last one.
  void begin(double duration, int bands);
  /// Drops the deferred events.
  void reset() { deferred_.clear(); }

  /// Adds an event `t` microseconds after the start of the interval; past its end, the event is
  /// deferred to the next interval. Different bands may be added from different threads.
  void add(int band, double t, int x, int y, Polarity polarity) {
    if (t > duration_) {
      deferred_[static_cast<std::size_t>(band)].push_back({t, Event::at(x, y, 0, polarity)});
      return;
    }
    const auto microseconds = static_cast<std::uint32_t>(t);
    collected_.bucket(static_cast<int>(microseconds >> shift_) + 1, band)
        .push_back(Event::at(x, y, microseconds, polarity));
  }

  /// Fills `events`, one bucket per time slice.
  void finish(EventBuckets& events, ThreadPool& threads);

 private:
  struct DeferredEvent {
    double t;
    Event event;
  };
  struct alignas(64) Deferred : std::vector<DeferredEvent> {};
  struct alignas(64) Counts : std::vector<std::uint32_t> {};

  void sort_slice(int slice, std::vector<std::uint32_t>& counts, std::vector<Event>& out);

  double duration_ = 0;
  int shift_ = 0;  ///< a time slice has 2^shift_ microseconds
  int slices_ = 1;
  EventBuckets collected_;          ///< by slice and band
  std::vector<Deferred> deferred_;  ///< by band
  std::vector<Counts> counts_;      ///< by thread
};

/// Adds the events of one band of rows to a sorter.
struct BandEvents {
  EventSorter& sorter;
  int band;

  void add(double t, int x, int y, Polarity polarity) const { sorter.add(band, t, x, y, polarity); }
};

/// Arbiter of the readout: reads one row at a time, the longest waiting row first, at a limited
/// event rate. The events of a row leave together and get the time at which they leave. A waiting
/// pixel drops further events, so events beyond the rate of the readout are lost, and at most one
/// event per pixel is waiting.
class Readout {
 public:
  Readout(int width, int height);

  /// Drops the waiting events.
  void reset();

  /// Admits the events of an interval of `duration` microseconds, and fills `out` with those that
  /// leave within it, sorted; the others stay for the next one.
  void pass(const EventBuckets& in, double duration, double events_per_second, EventBuckets& out);

 private:
  static constexpr int none = -1;

  struct WaitingEvent {
    Event event;
    int next;  ///< next one of its row
  };
  struct Row {
    int first = none;
    int last = none;
    int count = 0;
  };

  void admit(const Event& event);
  void serve(int row, std::uint32_t t, std::vector<Event>& out);

  std::uint8_t& waits(const Event& event) {
    return waits_[static_cast<std::size_t>(event.y()) * static_cast<std::size_t>(width_) + event.x];
  }

  int width_;
  std::vector<WaitingEvent> waiting_;  ///< linked lists: one per row, and one of free entries
  int free_ = none;
  std::vector<Row> rows_;
  std::vector<int> row_queue_;  ///< ring of the rows with waiting events
  std::size_t queue_first_ = 0;
  std::size_t queue_count_ = 0;
  std::vector<std::uint8_t> waits_;  ///< by pixel: 1 if its event is waiting
  double idle_from_ = 0;             ///< microseconds after the start of the interval
};

}  // namespace eventcamera
