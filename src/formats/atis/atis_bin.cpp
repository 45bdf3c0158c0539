// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/atis/atis_bin.hpp"

#include <set>

#include "src/formats/unit_stream_decoder.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {
namespace {

constexpr std::ptrdiff_t record_size = 5;
constexpr SensorSize atis{304, 240};

/// Bits from the highest: column (8), row (8), polarity (1), time in microseconds (23).
struct Record {
  std::uint32_t x;
  std::uint32_t y;
  bool is_on;
  std::uint32_t time;

  static constexpr int time_bits = 23;

  static Record at(const std::uint8_t* bytes) {
    return {bytes[0], bytes[1], bytes[2] >= 0x80,
            std::uint32_t{bytes[2] & 0x7fU} << 16 | std::uint32_t{bytes[3]} << 8 | bytes[4]};
  }

  /// Not an event: later times are shifted by overflow_time.
  bool is_overflow() const { return y == static_cast<std::uint32_t>(atis.height); }
};

constexpr std::uint64_t overflow_time = 1 << 13;

class AtisRecordDecoder final : public UnitDecoder {
 public:
  explicit AtisRecordDecoder(SensorSize size)
      : bounds_(size.width > 0 ? size : SensorSize{256, atis.height}, 256) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; to - from >= record_size && batch.end < batch.full(); from += record_size) {
      const auto record = Record::at(from);
      if (record.is_overflow()) {
        overflows_ += overflow_time;
        continue;
      }
      const auto time = static_cast<std::uint64_t>(clock_.follow(record.time));
      if (!bounds_.contain(record.x, record.y)) {
        batch.outside(1);
        continue;
      }
      *batch.end++ = {static_cast<Microseconds>(overflows_ + time),
                      static_cast<std::uint16_t>(record.x),
                      static_cast<std::uint16_t>(record.y | (record.is_on ? 0x8000U : 0U))};
    }
    return from;
  }

  State state() const override { return {clock_.time(), overflows_}; }
  void restore(const State& state) override {
    clock_.restore(state.clock);
    overflows_ = state.rest;
  }

 private:
  Bounds bounds_;
  UnwrappedClock<Record::time_bits> clock_;
  std::uint64_t overflows_ = 0;  ///< time of overflows
};

}  // namespace

std::unique_ptr<EventDecoder> make_atis_bin_decoder(SensorSize size) {
  return std::make_unique<UnitStreamDecoder>(std::make_unique<AtisRecordDecoder>(size), size);
}

bool is_atis_bin(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t examined = 300;  // more would change the result
  constexpr std::size_t min_pixels = 50;
  constexpr std::size_t min_times = 50;
  constexpr std::uint32_t max_first_time = 1'000'000;
  constexpr std::uint32_t max_pause = 1'000'000;
  if (bytes.size() < examined * record_size) return false;
  std::set<std::uint32_t> pixels;
  std::size_t times = 0;
  std::size_t on = 0;
  auto last = Record::at(bytes.data()).time;
  if (last > max_first_time) return false;
  for (std::size_t i = 0; i < examined; ++i) {
    const auto record = Record::at(bytes.data() + i * record_size);
    if (record.is_overflow()) continue;
    if (record.y > static_cast<std::uint32_t>(atis.height) || record.time < last ||
        record.time - last > max_pause)
      return false;
    times += record.time > last ? 1 : 0;
    on += record.is_on ? 1 : 0;
    last = record.time;
    pixels.insert(record.x << 8 | record.y);
  }
  return times >= min_times && pixels.size() >= min_pixels && on > 0 && on < examined;
}

}  // namespace eventcamera
