// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

namespace eventcamera {

/// A stream to merge: the events of an interval that are not merged yet.
class MergeInput {
 public:
  /// Starts an interval of this length. Copies its valid events, and their labels, if there are
  /// any.
  InvalidEvents load(std::span<const Event> events, std::span<const Label> labels,
                     SensorSize sensor, Microseconds length);

  /// Sets the interval's start in the merged stream, and the sensor's position on the merged one.
  void place(Microseconds start, int x, int y);

  /// Ends the interval, and drops its events that are not merged.
  void unload();
  bool is_loaded() const { return loaded_; }

  Microseconds start() const { return start_; }
  Microseconds end() const { return start_ + length_; }
  /// True if nothing is left after a merged interval that ends at `time`. An interval of length 0
  /// may still have events.
  bool is_merged(Microseconds time) const { return end() <= time && next_ == events_.size(); }

 private:
  friend class EventMerger;

  /// Events before this time belong to a merged interval that ends at `end`. Events at `end` do so
  /// only if this interval ends there, too.
  Microseconds end_of_part(Microseconds end) const;
  bool has_event_before(Microseconds time) const {
    return next_ < events_.size() && next_time() < time;
  }
  /// Time of the next event; there must be one.
  Microseconds next_time() const { return start_ + events_[next_].t; }
  /// Index of the first event that is not earlier than `time`, from the next one on.
  std::size_t first_at(Microseconds time) const;

  bool loaded_ = false;
  std::vector<Event> events_;
  std::vector<Label> labels_;  ///< as many as events, or none
  std::size_t next_ = 0;
  Microseconds start_ = 0;
  Microseconds length_ = 0;
  int x_ = 0;
  int y_ = 0;
};

/// Interval of the merged stream.
struct MergedInterval {
  Microseconds start = 0;
  Microseconds end = 0;
  std::size_t events = 0;
  bool labelled = false;
  std::size_t late = 0;  ///< number of events dropped because they are earlier than `start`
};

/// Merges sorted streams into one, interval by interval. Intervals follow each other without
/// overlap, and times do not change. Events of one microsecond are in the order of the inputs, then
/// in the order of their input. Only events at the very end of an interval, as simulators write
/// them, may precede events of earlier inputs in the same microsecond.
class EventMerger {
 public:
  using Inputs = std::span<MergeInput* const>;

  /// Returns the next interval, up to the earliest end of the inputs; there must be at least one,
  /// and all must be loaded. An interval without events ends at the next event or interval if
  /// 32-bit times require it, or if no input covers the time before. Unload the merged inputs
  /// afterwards.
  MergedInterval next(Inputs inputs);

  /// Writes the events of that interval, relative to its start, and their labels if it is labelled.
  /// Both must have its size.
  static void merge(Inputs inputs, const MergedInterval& interval, LabelledEvents out);

  /// True if an interval starts before the end of the last one.
  bool goes_back(const MergeInput& input) const;

  /// Forgets the time: the next interval may have any.
  void restart() { position_.reset(); }

 private:
  std::optional<Microseconds> position_;  ///< end of the last interval
};

}  // namespace eventcamera
