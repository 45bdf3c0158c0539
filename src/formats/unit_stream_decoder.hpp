// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Output of a UnitDecoder: a few thousand events, few enough to stay in the cache.
class Batch {
 public:
  /// Maximum number of events in one unit.
  static constexpr std::size_t events_per_unit = 32;
  /// Maximum number of events per byte; EVT3 vectors reach it.
  static constexpr std::size_t events_per_byte = 6;

  explicit Batch(Corruption& corruption) : corruption_(corruption) {}

  /// Places the batch after the events of `out`, to which close() adds it. Its capacity fits
  /// `bytes`: allocating more takes longer than decoding a few bytes.
  void open(Decoded& out, std::span<const std::uint8_t> bytes, std::uint64_t position) {
    constexpr std::size_t max_size = 4096;
    const auto size =
        std::min(max_size, events_per_unit + events_per_byte * std::min(bytes.size(), max_size));
    out_ = &out;
    const auto begin = out.events.size();
    out.events.resize(begin + size);
    end = out.events.data() + begin;
    full_ = end + size - events_per_unit;
    start_ = bytes.data();
    start_position_ = position;
  }

  void close() { out_->events.resize(static_cast<std::size_t>(end - out_->events.data())); }

  /// No further unit is read once `end` reaches this.
  AbsoluteEvent* full() const { return full_; }

  std::vector<Trigger>& triggers() { return out_->triggers; }

  /// Records that the bytes at `at` are not a valid unit. Consecutive bad units count as one place.
  void bad(const std::uint8_t* at, std::size_t bytes, const char* what) {
    const auto position = start_position_ + static_cast<std::uint64_t>(at - start_);
    if (position != bad_end_) corruption_.note(position, what);
    bad_end_ = position + bytes;
  }

  void outside(std::uint64_t events) { corruption_.outside += events; }
  void skipped(std::uint64_t items) { corruption_.skipped += items; }

  AbsoluteEvent* end = nullptr;  ///< end of the events

 private:
  Decoded* out_ = nullptr;
  const std::uint8_t* start_ = nullptr;  ///< start of the bytes
  std::uint64_t start_position_ = 0;     ///< its offset in the file
  AbsoluteEvent* full_ = nullptr;
  Corruption& corruption_;
  std::uint64_t bad_end_ = ~std::uint64_t{0};
};

/// Reads the units of a format: words, or fixed-size events.
class UnitDecoder {
 public:
  struct State {
    Microseconds clock = 0;
    std::uint64_t rest = 0;
  };

  /// Size of the longest unit, in bytes.
  static constexpr std::size_t max_size = 8;

  virtual ~UnitDecoder() = default;
  UnitDecoder(const UnitDecoder&) = delete;
  UnitDecoder& operator=(const UnitDecoder&) = delete;

  /// Reads units until the batch is full or no whole unit is left; returns the first byte not read.
  virtual const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                                   Batch& batch) = 0;

  /// Appends the events of the next batch of `bytes`, which are at `position` in the file, and
  /// returns the number of bytes read.
  std::size_t decode(std::span<const std::uint8_t> bytes, std::uint64_t position, Batch& batch,
                     Decoded& out) {
    batch.open(out, bytes, position);
    const auto* const end = read(bytes.data(), bytes.data() + bytes.size(), batch);
    batch.close();
    return static_cast<std::size_t>(end - bytes.data());
  }

  /// Complete state of the decoder; State{} at the start of the data.
  virtual State state() const = 0;
  virtual void restore(const State& state) = 0;

 protected:
  UnitDecoder() = default;
};

class Bounds {
 public:
  /// A sensor of unknown size has sides of `default_side` pixels.
  constexpr Bounds(SensorSize size, int default_side)
      : width_(static_cast<std::uint32_t>(size.width > 0 ? size.width : default_side)),
        height_(static_cast<std::uint32_t>(size.height > 0 ? size.height : default_side)) {}

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

/// EventDecoder for formats with a header followed by units of a few bytes.
class UnitStreamDecoder : public EventDecoder {
 public:
  UnitStreamDecoder(std::unique_ptr<UnitDecoder> decoder, SensorSize size) {
    begin(std::move(decoder), size);
  }

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) final;
  void finish(Decoded& out) final;

 protected:
  UnitStreamDecoder() = default;

  /// Consumes part of the header from the front of `bytes` and returns its size; 0 if more bytes
  /// are needed. Calls begin() at the end of the header. `ended`: no more bytes will follow. Throws
  /// UnsupportedFormat.
  virtual std::size_t read_header(std::span<const std::uint8_t> /*bytes*/, bool /*ended*/) {
    return 0;
  }

  void begin(std::unique_ptr<UnitDecoder> decoder, SensorSize size) {
    decoder_ = std::move(decoder);
    stream_.size = size;
  }

  /// Position of the first unit; valid only after begin().
  std::uint64_t units_begin() const { return units_begin_; }

 private:
  void restore(const SeekPoint& seek_point) final;
  void read_headers(bool ended);
  std::size_t read_units(std::span<const std::uint8_t> bytes, Decoded& out);

  std::unique_ptr<UnitDecoder> decoder_;  // null until the header is read
  std::vector<std::uint8_t> rest_;        // incomplete header or unit
  std::uint64_t position_ = 0;            // offset of the next byte to read
  std::uint64_t units_begin_ = 0;
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
  Batch batch_{corruption_};
};

}  // namespace eventcamera
