// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/event_buckets.hpp"

namespace eventcamera {

/// What lies between the pixels and the outside: an arbiter that takes the events of one row at a
/// time, the row first that waits longest, each event at its share of a second. A row's events
/// leave together and get the time at which they do. A pixel that waits makes no other event, so
/// what comes too fast for the readout is lost there, and never more waits than there are pixels.
class Readout {
 public:
  Readout(int width, int height);

  /// Forgets what waits.
  void reset();

  /// Takes the events of an interval of so many microseconds, and fills `out` with those that leave
  /// within it, sorted; the others leave in the next.
  void pass(const EventBuckets& in, double duration, double events_a_second, EventBuckets& out);

 private:
  static constexpr int none = -1;

  struct Waiting {
    Event event;
    int next;  ///< in its row
  };
  struct Row {
    int first = none;
    int last = none;
    int count = 0;
  };

  void admit(const Event& event);
  void serve(int row, std::uint32_t t, std::vector<Event>& out);

  int width_;
  std::vector<Waiting> waiting_;  ///< lists, one for each row and one of free places
  int free_ = none;
  std::vector<Row> rows_;
  std::vector<int> row_queue_;  ///< a ring of the rows in which something waits
  std::size_t queue_first_ = 0;
  std::size_t queue_count_ = 0;
  std::vector<std::uint8_t> waits_;  ///< pixel by pixel
  double idle_from_ = 0;             ///< microseconds after the start of the interval
};

}  // namespace eventcamera
