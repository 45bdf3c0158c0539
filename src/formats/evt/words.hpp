// SPDX-License-Identifier: LGPL-2.1-or-later
// Readers and encoders of the words of each EVT version, and what they share.
#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "src/formats/encoder.hpp"
#include "src/formats/time_base.hpp"
#include "src/formats/unit_reader.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {

/// The order of the bytes of EVT2.1's words: little-endian, or as Gen4.1 and IMX636 cameras have
/// it: the upper half first, each half little-endian.
enum class Evt21Order { little, legacy };

/// As Prophesee documents them ("EVT 2.0 Format" and so on), EVT4 as their OpenEB reads it. A size
/// of 0x0 is unknown.
std::unique_ptr<UnitReader> make_evt2_reader(SensorSize size);
std::unique_ptr<UnitReader> make_evt21_reader(Evt21Order order, SensorSize size);
std::unique_ptr<UnitReader> make_evt3_reader(SensorSize size);
std::unique_ptr<UnitReader> make_evt4_reader(SensorSize size);

/// `header` comes before the words.
std::unique_ptr<Encoder> make_evt2_encoder(std::string header);
std::unique_ptr<Encoder> make_evt21_encoder(Evt21Order order, std::string header);
std::unique_ptr<Encoder> make_evt3_encoder(SensorSize size, std::string header);
std::unique_ptr<Encoder> make_evt4_encoder(std::string header);

/// Columns and rows are numbers of 11 bits.
constexpr int max_evt_side = 2048;

/// Writes an event for each set bit of `mask`: bit i is i pixels to the right of `first`. Returns
/// the end of the events.
inline AbsoluteEvent* expand(std::uint32_t mask, const AbsoluteEvent& first,
                             AbsoluteEvent* events) {
  for (; mask != 0; mask &= mask - 1)
    *events++ = {first.t, static_cast<std::uint16_t>(first.x + std::countr_zero(mask)), first.y_p};
  return events;
}

/// A word of EVT2 or EVT4, or the upper half of one of EVT2.1.
struct CdWord {
  std::uint32_t bits;

  /// `time` is cut to its low bits.
  static constexpr CdWord at(std::uint32_t type, std::uint64_t time, std::uint32_t x,
                             std::uint32_t y) {
    return {type << 28 | (static_cast<std::uint32_t>(time) & 63) << 22 | (x & 0x7ff) << 11 |
            (y & 0x7ff)};
  }
  /// `count` is of 64 microseconds.
  static constexpr CdWord time_high(std::uint32_t type, std::uint64_t count) {
    return {type << 28 | (static_cast<std::uint32_t>(count) & 0x0fffffff)};
  }

  constexpr std::uint32_t type() const { return bits >> 28; }
  constexpr std::uint32_t count() const { return bits & 0x0fffffff; }
  constexpr std::uint32_t time_low() const { return bits >> 22 & 63; }
  constexpr std::uint32_t x() const { return bits >> 11 & 0x7ff; }
  constexpr std::uint32_t y() const { return bits & 0x7ff; }

  /// `time` is that of the last TIME_HIGH; the polarity is the lowest bit of the type.
  constexpr AbsoluteEvent event(std::uint64_t time) const {
    return {static_cast<Microseconds>(time + time_low()), static_cast<std::uint16_t>(x()),
            static_cast<std::uint16_t>(y() | (type() & 1) << 15)};
  }

  constexpr Trigger trigger(std::uint64_t time) const {
    return {static_cast<Microseconds>(time + time_low()),
            static_cast<std::uint16_t>(bits >> 8 & 31), (bits & 1) != 0};
  }
};

/// The types of words without events.
struct CdTypes {
  std::uint32_t time_high;
  std::uint32_t trigger;
  std::uint32_t ignored;  ///< a bit for each type
};

/// Reads EVT2, EVT2.1 or EVT4: all that they remember of earlier words is the time.
template <CdTypes types>
class CdReader : public UnitReader {
 public:
  State state() const override { return time_.state(); }
  void restore(const State& state) override { time_.restore(state.clock, state.rest != 0); }

 protected:
  CdReader(SensorSize size, const char* unknown_type)
      : bounds_(size, max_evt_side), unknown_type_(unknown_type) {}

  /// Reads a word, of so many bytes, that holds no event.
  void read_other(CdWord word, const std::uint8_t* at, std::size_t bytes, Batch& batch) {
    if (word.type() == types.time_high) {
      time_.follow(word.count());
    } else if (word.type() == types.trigger) {
      if (time_.known()) batch.triggers->push_back(word.trigger(time_.time()));
    } else if ((types.ignored >> word.type() & 1) == 0) {
      batch.bad(at, bytes, unknown_type_);
    }
  }

  /// Writes the events of a mask from `word`'s pixel on, where the time is known. Counts those
  /// outside the sensor, and returns the end of the others.
  AbsoluteEvent* read_masked(CdWord word, std::uint32_t mask, AbsoluteEvent* events,
                             std::uint64_t& outside) const {
    if (!time_.known()) return events;
    const auto valid = bounds_.of_32(word.x(), word.y());
    outside += static_cast<std::uint64_t>(std::popcount(mask & ~valid));
    return expand(mask & valid, word.event(time_.time()), events);
  }

  Bounds bounds_;
  TimeBase<28, 6> time_;

 private:
  const char* unknown_type_;
};

/// Events of one time, polarity and row, within 32 pixels from `base` on.
struct MaskedEvents {
  std::uint32_t base;
  std::uint32_t mask = 0;
  std::size_t count = 0;
};

/// The first of some events, as far as one mask holds them. A sensor's words begin at multiples of
/// 32, and hold what comes in the order of columns.
inline MaskedEvents first_masked(std::span<const AbsoluteEvent> events) {
  const auto& first = events.front();
  MaskedEvents masked{.base = first.x & ~31U};
  auto& count = masked.count;
  do {
    masked.mask |= std::uint32_t{1} << (events[count].x & 31);
    ++count;
  } while (count < events.size() && events[count].t == first.t && events[count].y_p == first.y_p &&
           events[count].x > events[count - 1].x && events[count].x - masked.base < 32);
  return masked;
}

/// Writes EVT2, EVT2.1 or EVT4. Format::put() writes the first of some events, at most two words
/// for each, and returns how many events that was; Format::time_high() makes a TIME_HIGH.
template <class Format>
class CdEncoder final : public Encoder {
 public:
  explicit CdEncoder(std::string header) : Encoder(std::move(header)) {}

 private:
  using Words = WordWriter<typename Format::Word>;

  static constexpr std::size_t words_at_once = 2 * events_at_once;
  static constexpr int bits = 28;
  static constexpr std::uint64_t max_wraps = (GapLimiter::max_gap >> (bits + 6)) + 1;
  static constexpr std::uint64_t none = ~std::uint64_t{0};

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, Words& words) {
      while (!few.empty()) {
        const auto t = few.front().t;
        if (gaps_.written(t) >> 6 != time_high_) [[unlikely]]
          put_time_high(t, words);
        few = few.subspan(Format::put(few, gaps_.written(t), words));
      }
    };
    write_events<typename Format::Word>(events, words_at_once, out, write);
  }

  void put_time_high(Microseconds t, Words& words) {
    gaps_.reach(t);
    const auto count = gaps_.written(t) >> 6;
    const auto wraps = (count >> bits) - (time_high_ == none ? 0 : time_high_ >> bits);
    if (wraps != 0 && wraps <= max_wraps) [[unlikely]] {
      // Readers know a wrap by the fall from nearly the largest count to nearly zero (OpenEB allows
      // 10 ms), so each is written out.
      words.reserve(2 * wraps + 1 + words_at_once);
      for (std::uint64_t i = 0; i < wraps; ++i) {
        words.put(Format::time_high((std::uint64_t{1} << bits) - 1));
        words.put(Format::time_high(0));
      }
    }
    words.put(Format::time_high(count));
    time_high_ = count;
  }

  GapLimiter gaps_;
  std::uint64_t time_high_ = none;
};

}  // namespace eventcamera
