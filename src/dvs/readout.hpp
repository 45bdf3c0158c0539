// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/dvs/state_bytes.hpp"

namespace eventcamera {

/// Arbiter of the readout: reads one row at a time, the longest waiting row first, at a limited
/// event rate. The events of a row take the time of its readout. A waiting pixel drops further
/// events, so events beyond the readout rate are lost, and at most one event per pixel waits.
class Readout {
 public:
  Readout(int width, int height);

  /// Drops the causes of the waiting events.
  void drop_causes() {
    for (auto& waiting : waiting_) waiting.event = without_cause(waiting.event);
  }

  /// Drops the waiting events.
  void reset();

  /// Admits the sorted events of an interval of `duration` microseconds, with_cause(), and fills
  /// `out` with those read out within it; the others wait for the next interval.
  void read(std::span<const Event> in, double duration, double events_per_second,
            EventBuckets& out);

  /// Passes the waiting events to a StateWriter or StateReader.
  template <class State>
  void pass(State& state);

 private:
  static constexpr int none = -1;

  struct WaitingEvent {
    Event event;
    int next;  ///< next entry of the same list
  };
  struct Row {
    int first = none;
    int last = none;
    int count = 0;
  };

  /// Its pixel must lie on the sensor.
  void admit(const Event& event);
  void serve(int row, std::uint32_t t, std::vector<Event>& out);

  std::uint8_t& waits(const Event& event) {
    const Event pixel = without_cause(event);
    return waits_[static_cast<std::size_t>(pixel.y()) * static_cast<std::size_t>(width_) + pixel.x];
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

template <class State>
void Readout::pass(State& state) {
  if constexpr (State::is_reading) reset();
  state.value(idle_from_, is_within(0.0, max_state_time));
  // In the order in which they are read, which admits them again.
  std::vector<Event> events;
  for (std::size_t i = 0; i < queue_count_; ++i) {
    const int row = row_queue_[(queue_first_ + i) % row_queue_.size()];
    for (int place = rows_[static_cast<std::size_t>(row)].first; place != none;
         place = waiting_[static_cast<std::size_t>(place)].next)
      events.push_back(waiting_[static_cast<std::size_t>(place)].event);
  }
  events.resize(state.count(events.size(), sizeof(Event)));
  for (auto& event : events)
    state.value(event, is_event_within({0, 0, width_, static_cast<int>(rows_.size())}));
  if constexpr (State::is_reading)
    for (const auto& event : events) admit(event);
}

}  // namespace eventcamera
