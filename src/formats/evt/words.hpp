// SPDX-License-Identifier: LGPL-2.1-or-later
// The words of EVT formats.
#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/formats/encoder.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/unit_stream_decoder.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {

/// Columns and rows have 11 bits.
constexpr int max_evt_side = 2048;

/// Corruption of a TIME_HIGH, or of the one before it.
inline constexpr const char* time_falls = "EVT time falls without a wrap";

/// A size of 0x0 means unknown.
std::unique_ptr<UnitDecoder> make_evt_unit_decoder(EvtFormat format, SensorSize size);
std::unique_ptr<UnitDecoder> make_evt3_unit_decoder(SensorSize size);

/// `header` is written before the words.
std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size, std::string header);
std::unique_ptr<Encoder> make_evt3_encoder(SensorSize size, std::string header);

/// Unwraps a counter of `bits` bits in units of 2^`shift` microseconds, as in TIME_HIGH words.
///
/// Counts rise in small steps, in which they may wrap. Any other count is a leap, after a pause or
/// a flipped bit, and wraps only if it is of 12 bits and falls by half of its range or more, as in
/// OpenEB. If the next count continues from before the leap, so does the time.
template <int bits, int shift>
class TimeBase {
 public:
  bool known() const { return known_; }
  std::uint32_t count() const { return count_of(time_); }

  /// In microseconds; unsigned, because overflow must be well-defined for any file.
  std::uint64_t time() const { return time_; }

  /// Advances to the next time at `count`. False if time goes back: this count or the previous one
  /// is corrupt.
  bool follow(std::uint32_t count) {
    const auto last = time_;
    const auto from = step(before_leap_, count) <= max_step ? before_leap_ : last;
    if (!known_) {
      advance_to(std::uint64_t{count} << shift);
    } else if (step(from, count) <= max_step) {
      advance_to(from + (std::uint64_t{step(from, count)} << shift));
    } else {
      before_leap_ = last;
      time_ += leap(count_of(last), count) << shift;
    }
    known_ = true;
    return static_cast<std::int64_t>(time_ - last) >= 0;
  }

  /// Limit of small steps; 0 after a leap, which follow() judges by the next count.
  std::uint32_t small_step_end() const { return before_leap_ == time_ ? max_step + 1 : 0; }

  /// Sets the time after small steps.
  void advance_to(std::uint64_t time) { before_leap_ = time_ = time; }

  /// Uses bits 0 to `bits` of the rest.
  UnitDecoder::State state() const {
    return {static_cast<Microseconds>(time_),
            std::uint64_t{count_of(before_leap_)} << 1 | static_cast<std::uint64_t>(known_)};
  }

  void restore(const UnitDecoder::State& state) {
    time_ = static_cast<std::uint64_t>(state.clock);
    before_leap_ =
        time_ - (leap(static_cast<std::uint32_t>(state.rest >> 1) & mask, count()) << shift);
    known_ = (state.rest & 1) != 0;
  }

 private:
  /// Limit of small steps: two minutes for 28 bits; four seconds for 12 bits, the steps in which
  /// faery writes pauses. A flipped bit causes no such step across the wrap.
  static constexpr std::uint32_t max_step = std::uint32_t{1} << (bits == 12 ? 10 : 21);
  /// Limit of leaps across the wrap.
  static constexpr std::uint32_t max_wrapping_leap = bits == 12 ? 1 << 11 : max_step;
  static constexpr std::uint32_t mask = ~std::uint32_t{0} >> (32 - bits);

  static std::uint32_t count_of(std::uint64_t time) {
    return static_cast<std::uint32_t>(time >> shift) & mask;
  }

  /// Counts from `time` to the next time at `count`.
  static std::uint32_t step(std::uint64_t time, std::uint32_t count) {
    return (count - count_of(time)) & mask;
  }

  /// Counts from one to another, modulo 2^64.
  static std::uint64_t leap(std::uint32_t from, std::uint32_t to) {
    const auto step = (to - from) & mask;
    return step <= max_wrapping_leap ? step : std::uint64_t{to} - from;
  }

  std::uint64_t time_ = 0;
  std::uint64_t before_leap_ = 0;  ///< the time itself if the last step was small
  bool known_ = false;
};

/// Encodes words with a `State`, which has
/// - is_at(time): true if no word is due before an event at this time;
/// - prepare(time, words): writes the words that are due, or reserves space for them;
/// - write(events, time, words): encodes the first of these events, and returns their number;
/// - write_trigger(trigger, time, words).
template <class State>
class WordEncoder final : public Encoder {
 public:
  WordEncoder(SensorSize size, std::string header)
      : Encoder(std::move(header)), state_(size.width) {}

  std::uint64_t removed_time() const override { return gaps_.removed_time(); }

 private:
  using Words = WordWriter<typename State::Word>;

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, Words& words) {
      const auto all = few;
      while (!few.empty()) {
        auto time = gaps_.written(few.front().t);
        if (!state_.is_at(time)) [[unlikely]] {
          gaps_.pass(all.first(all.size() - few.size()));
          time = advance_to(few.front().t, words);
        }
        few = few.subspan(state_.write(few, time, words));
      }
      gaps_.pass(all);
    };
    write_events<typename State::Word>(events, State::words_at_once, out, write);
  }

  bool append_trigger(const Trigger& trigger, std::vector<std::uint8_t>& out) override {
    if (trigger.id > State::max_trigger_id) return false;
    Words words(out);
    words.reserve(State::words_at_once);
    state_.write_trigger(trigger, advance_to(trigger.t, words), words);
    return true;
  }

  /// Returns the time as it is written.
  std::uint64_t advance_to(Microseconds t, Words& words) {
    gaps_.advance_to(t);
    const auto time = gaps_.written(t);
    state_.prepare(time, words);
    return time;
  }

  State state_;
  GapLimiter gaps_;
};

/// Writes an event for each set bit i of `mask`, i pixels to the right of `first`. Returns the end
/// of the events.
inline AbsoluteEvent* expand(std::uint32_t mask, const AbsoluteEvent& first,
                             AbsoluteEvent* events) {
  for (; mask != 0; mask &= mask - 1)
    *events++ = {first.t, static_cast<std::uint16_t>(first.x + std::countr_zero(mask)), first.y_p};
  return events;
}

}  // namespace eventcamera
