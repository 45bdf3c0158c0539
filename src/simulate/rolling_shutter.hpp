// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/fired_pixels.hpp"

namespace eventcamera {

/// Delay of each row of a frame after the row that the camera reads first, in microseconds, rounded
/// down. `readout` is the time from the first row read to the last, from top to bottom or, if
/// negative, from bottom to top.
std::vector<std::uint32_t> row_delays(Nanoseconds readout, int height);

/// Events of an interval between two frames of a camera with a rolling shutter: StepBuckets,
/// delayed by row. Events past the end of the interval are deferred to the next one.
///
/// Sorts rows instead of events, because all events of a row and step have the same time.
class DelayedRows final : public EventBuckets {
 public:
  explicit DelayedRows(int height) : height_(height) {}

  /// Replaces the events by those of the next interval and the deferred ones that are due.
  /// `events` must stay unchanged while this is used. `readout` is as for row_delays().
  void set(const StepBuckets& events, Nanoseconds duration, Nanoseconds readout);

  /// Time from the end of the interval to the last deferred event, if any.
  std::optional<Nanoseconds> latest() const;

  void restart() { deferred_ = {}; }

  std::size_t size() const override { return size_; }
  void visit_band(int band, const Visit& visit) const override;

 private:
  /// Events of a row with the same time, in either of two forms.
  struct Row {
    std::uint64_t t;
    int y;
    std::size_t size;
    std::span<const Event> events;
    std::span<const FiredPixels::Group> pixels;
  };
  /// Rows and copies of their events. Their times are relative to the next interval.
  struct Deferred {
    std::vector<Row> rows;
    std::vector<Event> events;
    std::vector<FiredPixels::Group> pixels;
  };
  struct SortedRow {
    std::uint64_t time_and_y;
    std::size_t row;    ///< index in rows_
    std::size_t first;  ///< index of its first event in the interval
  };

  static void write(const Row& row, Event* out);
  void write_part(std::size_t first, std::size_t last, Event* out) const override;
  void add_due();
  void add_list(std::span<const Event> events);
  void add(Row row);
  void sort();

  int height_;
  Nanoseconds readout_ = 0;
  std::vector<std::uint32_t> delays_;  ///< by row
  std::uint32_t end_ = 0;              ///< of the interval, microseconds
  std::uint32_t next_start_ = 0;       ///< of the next interval, rounded up
  std::vector<Row> rows_;
  std::vector<SortedRow> sorted_;
  std::size_t size_ = 0;
  Deferred deferred_;
  Deferred due_;  ///< deferred by the last interval
};

}  // namespace eventcamera
