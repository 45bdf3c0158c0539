// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

namespace eventcamera {

/// 30-bit time: microseconds after a moving epoch; 0 = never. Stamps are compared by age, now -
/// stamp, which is exact below max_stamp_age. Older stamps, and `never`, saturate at max_stamp_age.
using Stamp = std::uint32_t;

inline constexpr int stamp_bits = 30;

/// 9 minutes.
inline constexpr Stamp max_stamp_age = Stamp{1} << (stamp_bits - 1);

/// Maximum age that filters can compare.
inline constexpr Nanoseconds max_filter_time = 500'000'000'000;
static_assert(max_filter_time / 1000 < Microseconds{max_stamp_age});

/// Microseconds of a time of at most max_filter_time, rounded up.
constexpr Stamp in_stamps(Nanoseconds time) {
  return static_cast<Stamp>((time + 999) / 1000);
}

/// Stamp after the epoch has moved by `amount`.
constexpr Stamp lowered(Stamp stamp, std::uint64_t amount) {
  return stamp > amount ? static_cast<Stamp>(stamp - amount) : 0;
}

/// Stamps the times of one stream.
class StampClock {
 public:
  /// Returns the stamp of `time`, at least max_stamp_age. If the epoch moves, calls lower(amount)
  /// first: the owner of stamps must lower them all.
  template <class Lower>
  Stamp at(Microseconds time, const Lower& lower) {
    const auto stamp = static_cast<std::uint64_t>(time) - static_cast<std::uint64_t>(epoch_);
    if (stamp < std::uint64_t{1} << stamp_bits) [[likely]]
      return static_cast<Stamp>(stamp);
    epoch_ = time - Microseconds{max_stamp_age};
    lower(stamp - max_stamp_age);
    return max_stamp_age;
  }

 private:
  Microseconds epoch_ = -(Microseconds{1} << 62);  ///< the first time lowers all stamps to never
};

/// Whether pixels have a cell for all their events, or one for each polarity.
enum class CellsPerPixel { one, one_per_polarity };

/// Addresses of the cells of pixels.
template <class Cell>
struct StampedCells {
  Cell* first;            ///< of the pixel (0, 0)
  std::ptrdiff_t stride;  ///< bytes from a cell to the one below
  int rows_of_on;         ///< the cells of ON events are this many rows below

  Cell* at(const Event& event) const {
    const std::ptrdiff_t row = event.y() + (event.y_p >> 15) * rows_of_on;
    return reinterpret_cast<Cell*>(reinterpret_cast<std::byte*>(first) + row * stride) + event.x;
  }
};

/// Events to keep or drop.
template <class Cell>
struct StampedBatch {
  std::span<const Event> events;
  Stamp start;  ///< the stamp of an event is this + t, modulo 2^32
  StampedCells<Cell> cells;
  bool* is_kept;  ///< result, one for each event
};

/// Cells with stamps, one or two per pixel, and a margin of pixels that never fire. A cell of all
/// zeros has seen no event. Cells other than Stamp have lower(amount).
template <class Cell>
class StampedPixels {
 public:
  explicit StampedPixels(SensorSize sensor, int margin = 0,
                         CellsPerPixel cells = CellsPerPixel::one)
      : rows_of_on_(cells == CellsPerPixel::one ? 0 : sensor.height + margin),
        cells_(sensor.width, sensor.height + rows_of_on_, margin) {}

  /// Filters events: keep(event, now, cell) decides on each, in order.
  template <class Keep>
  LabelledEvents keep_if(LabelledEvents events, Microseconds start, Keep keep) {
    if (events.events.empty()) return events;
    const auto stamp_of = [this, start](const Event& event) {
      return std::int64_t{now(start + event.t)};
    };
    const auto cells = this->cells();
    const auto& first = events.events.front();
    return keep_if_prefetched(
        events, [cells](const Event& event) { __builtin_prefetch(cells.at(event), 1); },
        [=, origin = stamp_of(first) - first.t](const Event& event) mutable {
          std::int64_t stamp = origin + event.t;
          if (stamp >> stamp_bits != 0) [[unlikely]] {
            stamp = stamp_of(event);
            origin = stamp - event.t;
          }
          return keep(event, static_cast<Stamp>(stamp), cells.at(event));
        });
  }

  /// Filters events in batches: decide(batch) sets batch.is_kept of each.
  template <class Decide>
  LabelledEvents keep_batches(LabelledEvents events, Microseconds start, const Decide& decide) {
    std::array<bool, max_batch_size> is_kept;
    auto rest = events.events;
    return events.keep_if([=, this, &decide, decided = is_kept.data(), next = is_kept.data(),
                           end = is_kept.data()](const Event& first) mutable {
      if (next == end) {
        const Stamp stamp = now(start + first.t);
        const std::size_t size = batch_size(rest, stamp);
        decide(StampedBatch<Cell>{rest.first(size), stamp - first.t, cells(), decided});
        rest = rest.subspan(size);
        next = decided;
        end = decided + size;
      }
      return *next++;
    });
  }

  void forget() {
    for_each([](Cell& cell) { cell = {}; });
    clock_ = {};
  }

 private:
  static constexpr std::size_t max_batch_size = 128;

  StampedCells<Cell> cells() { return {cells_.row(0), cells_.stride(), rows_of_on_}; }

  Stamp now(Microseconds time) {
    return clock_.at(time, [this](std::uint64_t amount) {
      for_each([amount](Cell& cell) {
        if constexpr (std::same_as<Cell, Stamp>)
          cell = lowered(cell, amount);
        else
          cell.lower(amount);
      });
    });
  }

  /// Number of events of a batch, whose stamps count from the stamp of the first.
  static std::size_t batch_size(std::span<const Event> events, Stamp first) {
    const auto size = std::min(events.size(), max_batch_size);
    const std::uint64_t last = first + std::uint64_t{events[size - 1].t} - events.front().t;
    return last < std::uint64_t{1} << stamp_bits ? size : 1;
  }

  template <class Change>
  void for_each(const Change& change) {
    for (int y = 0; y < cells_.height(); ++y)
      std::for_each_n(cells_.row(y), cells_.width(), change);
  }

  int rows_of_on_;
  Image<Cell> cells_;
  StampClock clock_;
};

}  // namespace eventcamera
