// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "src/formats/word_writer.hpp"

namespace eventcamera {

namespace evt3 {

/// Types of words, in their upper four bits.
enum Type : std::uint32_t {
  addr_y = 0x0,
  em_addr_y = 0x1,
  addr_x = 0x2,
  vect_base_x = 0x3,
  vect_12 = 0x4,
  vect_8 = 0x5,
  time_low = 0x6,
  continued_4 = 0x7,
  time_high = 0x8,
  ext_trigger = 0xa,
  others = 0xe,
  continued_12 = 0xf,
};

/// Word that the cameras of Lucid fill their packets with, wherever these end.
constexpr std::uint32_t padding = 0x9999;

}  // namespace evt3

/// Writes EVT3 words, restricted to what all known readers interpret equally: vectors are complete
/// (VECT_BASE_X, VECT_12, VECT_12, VECT_8) and within the sensor, every TIME_HIGH is followed by a
/// TIME_LOW, and there is a TIME_HIGH every 4096 microseconds, including pauses, because readers
/// count wraps by them.
class Evt3Words {
 public:
  /// Maximum number of words of one call of write(), besides steps_to() words.
  static constexpr std::size_t max_words = 6;

  /// Maximum number of events of one call of write().
  static constexpr std::size_t max_events = 32;

  explicit Evt3Words(int width) : width_(static_cast<std::uint32_t>(width)) {}

  /// Number of TIME_HIGH words to write before an event at `time`, past a pause; more than
  /// max_steps, and only one is written, if time goes backwards.
  std::uint64_t steps_to(std::uint64_t time) const { return (time >> 12) - high_; }
  static constexpr std::uint64_t max_steps = (GapLimiter::max_gap >> 12) + 2;

  /// Lets the next write(), at `time`, state time and row, so that readers can begin there. Writes
  /// no TIME_HIGH for a pause of more than `max_pause` microseconds.
  void begin_packet(std::uint64_t time, std::uint64_t max_pause) {
    const auto high = time >> 12;
    if (high - high_ > max_pause >> 12)
      high_ = high - 1;
    else if (high_ != before_first)
      --high_;
    low_ = y_ = none;
  }

  /// Writes the first event, at `time`, or the first few as a vector; returns their number. Events
  /// are Event or AbsoluteEvent, sorted, and within the sensor.
  template <class AnyEvent>
  std::size_t write(std::span<const AnyEvent> events, std::uint64_t time,
                    WordWriter<std::uint16_t>& words) {
    advance_to(time, words);
    const auto& event = events.front();
    const auto polarity = static_cast<std::uint32_t>(event.y_p & 0x8000) >> 4;
    if (const auto y = static_cast<std::uint32_t>(event.y()) & 0x7ff; y != y_) {
      words.put(word(evt3::addr_y, y));
      y_ = y;
    }
    const auto vector = vector_of(events);
    if (vector.events == 0) {
      words.put(word(evt3::addr_x, (event.x & 0x7ff) | polarity));
      return 1;
    }
    words.put(word(evt3::vect_base_x, vector.base | polarity));
    words.put(word(evt3::vect_12, vector.mask & 0xfff));
    words.put(word(evt3::vect_12, vector.mask >> 12 & 0xfff));
    words.put(word(evt3::vect_8, vector.mask >> 24));
    return vector.events;
  }

  static constexpr std::uint16_t max_trigger_id = 15;

  /// Writes the edge of a trigger at `time`.
  void write_trigger(const Trigger& trigger, std::uint64_t time, WordWriter<std::uint16_t>& words) {
    advance_to(time, words);
    words.put(word(evt3::ext_trigger, std::uint32_t{trigger.id} << 8 | (trigger.rising ? 1U : 0U)));
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t{0};
  static constexpr std::uint64_t before_first = ~std::uint64_t{0};  ///< one before 0

  struct Vector {
    std::size_t events = 0;  ///< 0: a vector does not pay off
    std::uint32_t base = 0;
    std::uint32_t mask = 0;
  };

  static constexpr std::uint16_t word(std::uint32_t type, std::uint32_t payload) {
    return static_cast<std::uint16_t>(type << 12 | payload);
  }

  void advance_to(std::uint64_t time, WordWriter<std::uint16_t>& words) {
    if (const auto high = time >> 12; high != high_) {
      if (steps_to(time) > max_steps) high_ = high - 1;
      while (high_ != high)
        words.put(word(evt3::time_high, static_cast<std::uint32_t>(++high_) & 0xfff));
      low_ = none;
    }
    if (const auto low = static_cast<std::uint32_t>(time) & 0xfff; low != low_) {
      words.put(word(evt3::time_low, low));
      low_ = low;
    }
  }

  /// Returns the first events that fit into one vector.
  template <class AnyEvent>
  Vector vector_of(std::span<const AnyEvent> events) const {
    // A vector takes four words, like four events.
    constexpr std::size_t min_events = 5;
    if (width_ < 32 || events.size() < min_events) return {};
    const auto& event = events.front();
    const auto base = std::min<std::uint32_t>(event.x, width_ - 32);
    const auto fits = [&](const AnyEvent& next) {
      return next.t == event.t && next.y_p == event.y_p && next.x - base < 32;
    };
    if (event.x - base >= 32 || !fits(events[min_events - 1])) return {};
    Vector vector{1, base, std::uint32_t{1} << (event.x - base)};
    for (std::size_t i = 1; i < events.size() && fits(events[i]); ++i) {
      if (events[i].x <= events[i - 1].x) break;
      vector.mask |= std::uint32_t{1} << (events[i].x - base);
      ++vector.events;
    }
    return vector.events >= min_events ? vector : Vector{};
  }

  std::uint32_t width_;
  std::uint64_t high_ = before_first;
  std::uint32_t low_ = none;
  std::uint32_t y_ = none;
};

}  // namespace eventcamera
