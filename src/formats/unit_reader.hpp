// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/little_endian.hpp"

namespace eventcamera {

/// Output of a UnitReader: a few thousand events, few enough to stay in the cache.
class Batch {
 public:
  /// Maximum number of events in one unit.
  static constexpr std::size_t events_per_unit = 32;

  explicit Batch(Corruption& corruption) : corruption_(corruption) {}

  AbsoluteEvent* begin() { return events_.data(); }

  /// From here on no further unit is read.
  AbsoluteEvent* full() { return events_.data() + events_.size() - events_per_unit; }

  /// Records that the bytes at `at` are not a valid unit. Consecutive bad units count as one place.
  void bad(const std::uint8_t* at, std::size_t bytes, const char* what) {
    const auto position = start_position + static_cast<std::uint64_t>(at - start);
    if (position != bad_end_) corruption_.note(position, what);
    bad_end_ = position + bytes;
  }

  void outside(std::uint64_t events) { corruption_.outside += events; }

  AbsoluteEvent* end = nullptr;              ///< end of the events
  std::vector<Trigger>* triggers = nullptr;  ///< appended to
  const std::uint8_t* start = nullptr;       ///< start of the bytes
  std::uint64_t start_position = 0;          ///< its offset in the file

 private:
  std::array<AbsoluteEvent, 4096> events_;
  Corruption& corruption_;
  std::uint64_t bad_end_ = ~std::uint64_t{0};
};

/// Reads the units of a format: words, or fixed-size events.
class UnitReader {
 public:
  struct State {
    Microseconds clock = 0;
    std::uint64_t rest = 0;
  };

  /// Size of the longest unit, in bytes.
  static constexpr std::size_t longest = 8;

  virtual ~UnitReader() = default;
  UnitReader(const UnitReader&) = delete;
  UnitReader& operator=(const UnitReader&) = delete;

  /// Reads units until the batch is full or no whole unit is left; returns the first byte not read.
  virtual const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                                   Batch& batch) = 0;

  /// Complete state of the reader; State{} at the start of the data.
  virtual State state() const = 0;
  virtual void restore(const State& state) = 0;

 protected:
  UnitReader() = default;
};

/// Bounds of a sensor.
class Bounds {
 public:
  /// A sensor of unknown size has sides of `largest` pixels.
  constexpr Bounds(SensorSize size, int largest)
      : width_(static_cast<std::uint32_t>(size.width > 0 ? size.width : largest)),
        height_(static_cast<std::uint32_t>(size.height > 0 ? size.height : largest)) {}

  constexpr bool contain(std::uint32_t x, std::uint32_t y) const {
    return static_cast<bool>(static_cast<int>(x < width_) & static_cast<int>(y < height_));
  }

  /// Mask of the 32 pixels from (x, y) to the right: bit i is set if (x + i, y) is within.
  constexpr std::uint32_t of_32(std::uint32_t x, std::uint32_t y) const {
    if (x >= width_ || y >= height_) return 0;
    const auto left = width_ - x;
    return left >= 32 ? ~std::uint32_t{0} : (std::uint32_t{1} << left) - 1;
  }

 private:
  std::uint32_t width_;
  std::uint32_t height_;
};

}  // namespace eventcamera
