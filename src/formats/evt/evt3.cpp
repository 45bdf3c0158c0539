// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT3: 16-bit words, each of which updates the state for subsequent events, or adds events.
#include <algorithm>
#include <utility>

#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"

namespace eventcamera {
namespace {

using namespace evt3;

constexpr std::uint32_t polarity_bit = 0x800;

/// Row or column beyond any sensor: none yet, or not one of events.
constexpr std::uint32_t nowhere = 0x1fff;

class Evt3Decoder final : public UnitDecoder {
 public:
  explicit Evt3Decoder(SensorSize size) : bounds_(size, max_evt_side) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* const full = batch.full();
    while (to - from >= 2 && batch.end < full) {
      if (time_.known() && y_ != nowhere) from = read_common(from, to, batch);
      if (to - from >= 2 && batch.end < full) from = read_any(from, to, batch);
    }
    return from;
  }

  State state() const override {
    auto state = time_.state();
    state.rest |= std::uint64_t{low_} << 16 | std::uint64_t{polarity_} << 17 |
                  std::uint64_t{y_ ^ nowhere} << 32 | std::uint64_t{base_ ^ nowhere} << 48;
    return state;
  }

  void restore(const State& state) override {
    time_.restore(state);
    low_ = static_cast<std::uint32_t>(state.rest >> 16) & 0xfff;
    polarity_ = static_cast<std::uint32_t>(state.rest >> 17) & polarity_bit;
    y_ = (static_cast<std::uint32_t>(state.rest >> 32) & 0xffff) ^ nowhere;
    base_ = static_cast<std::uint32_t>(state.rest >> 48) ^ nowhere;
  }

 private:
  static constexpr auto common_types = 1U << addr_y | 1U << addr_x | 1U << time_low | 1U << others |
                                       1U << continued_4 | 1U << continued_12;

  /// Fast path: reads rows, events, low bits of times and skipped words, up to any other word.
  const std::uint8_t* read_common(const std::uint8_t* from, const std::uint8_t* to, Batch& batch) {
    auto* event = batch.end;
    const auto bounds = bounds_;
    const auto same_high = time_high << 12 | time_.count();
    // `low` includes the type bits of its word, which `high` compensates.
    const auto high = time_.time() - (time_low << 12);
    auto low = time_low << 12 | low_;
    auto y = y_;
    std::uint64_t seen = 0;
    const auto* const end = from + 2 * std::min((to - from) / 2, batch.full() - event);
    for (; from != end; from += 2) {
      const std::uint32_t word = little_endian<std::uint16_t>(from);
      const auto type = word >> 12;
      // Repeated TIME_HIGH words are frequent, too.
      const auto is_common =
          (common_types >> type & 1) | static_cast<std::uint32_t>(word == same_high);
      if (is_common == 0) [[unlikely]]
        break;
      // Branch-free, because the order of these words is unpredictable.
      const auto x = word & 0x7ff;
      y = type == addr_y ? x : y;
      low = type == time_low ? word : low;
      *event = event_at(high + low, x, y, word & polarity_bit);
      const auto is_event = static_cast<int>(type == addr_x);
      event += is_event & static_cast<int>(bounds.contain(x, y));
      seen += static_cast<std::uint64_t>(is_event);
    }
    y_ = y;
    low_ = low & 0xfff;
    batch.outside(seen - static_cast<std::uint64_t>(event - batch.end));
    batch.end = event;
    return from;
  }

  /// Reads a word of any type, or the words of a vector.
  const std::uint8_t* read_any(const std::uint8_t* at, const std::uint8_t* to, Batch& batch) {
    const std::uint32_t word = little_endian<std::uint16_t>(at);
    const auto t = time_.time() + low_;
    switch (const auto type = word >> 12) {
      case addr_y:
        y_ = word & 0x7ff;
        break;
      case em_addr_y:
        y_ = nowhere;
        break;
      case addr_x:
        expand_at(t, word & 0x7ff, word & polarity_bit, 1, batch);
        break;
      case vect_base_x: {
        base_ = word & 0x7ff;
        polarity_ = word & polarity_bit;
        if (to - at < 8) break;
        // Complete vector, as cameras and Evt3Words writes it.
        const auto masks = little_endian<std::uint64_t>(at) >> 16;
        if ((masks & 0xf000f000f000) != 0x500040004000) break;
        const auto mask = (masks & 0xfff) | (masks >> 4 & 0xfff000) | (masks >> 8 & 0xff000000);
        expand_at(t, base_, polarity_, static_cast<std::uint32_t>(mask), batch);
        base_ += 32;
        return at + 8;
      }
      case vect_12:
      case vect_8: {
        if (base_ == nowhere) {
          batch.bad(at, 2, "EVT3 vector without a base column");
          break;
        }
        expand_at(t, base_, polarity_, word & (type == vect_12 ? 0xfff : 0xff), batch);
        base_ = std::min(base_ + (type == vect_12 ? 12 : 8), nowhere - 1);
        break;
      }
      case time_low:
        low_ = word & 0xfff;
        break;
      case time_high: {
        const auto count = word & 0xfff;
        if (!time_.known() || count != time_.count()) low_ = 0;
        if (!time_.follow(count)) batch.bad(at, 2, time_falls);
        break;
      }
      case ext_trigger:
        if (time_.known())
          batch.triggers().push_back({static_cast<Microseconds>(t),
                                      static_cast<std::uint16_t>(word >> 8 & 15), (word & 1) != 0});
        break;
      case others:
      case continued_4:
      case continued_12:
        break;
      default:
        if (word != padding) batch.bad(at, 2, "EVT3 word of unknown type");
    }
    return at + 2;
  }

  /// Adds events of the current row, if row and time are known.
  void expand_at(std::uint64_t t, std::uint32_t x, std::uint32_t polarity, std::uint32_t mask,
                 Batch& batch) {
    if (!time_.known() || y_ == nowhere) return;
    const auto valid = bounds_.of_32(x, y_);
    batch.end = expand(mask & valid, event_at(t, x, y_, polarity), batch.end);
    batch.outside(static_cast<std::uint64_t>(std::popcount(mask & ~valid)));
  }

  static AbsoluteEvent event_at(std::uint64_t t, std::uint32_t x, std::uint32_t y,
                                std::uint32_t polarity) {
    static_assert(polarity_bit << 4 == 0x8000);
    return {static_cast<Microseconds>(t), static_cast<std::uint16_t>(x),
            static_cast<std::uint16_t>(y | polarity << 4)};
  }

  Bounds bounds_;
  TimeBase<12, 12> time_;
  std::uint32_t low_ = 0;
  std::uint32_t y_ = nowhere;
  std::uint32_t base_ = nowhere;
  std::uint32_t polarity_ = 0;  // polarity of vectors
};

class Evt3State : public Evt3Words {
 public:
  using Word = std::uint16_t;
  using Evt3Words::Evt3Words;

  static constexpr std::size_t words_at_once = 4 * events_at_once;

  bool is_at(std::uint64_t time) const { return steps_to(time) == 0; }

  /// Reserves space for the words of a pause.
  void prepare(std::uint64_t time, WordWriter<Word>& words) const {
    const auto steps = steps_to(time);
    if (steps > 1 && steps <= max_steps) [[unlikely]]
      words.reserve(steps + words_at_once);
  }
};

}  // namespace

std::unique_ptr<UnitDecoder> make_evt3_unit_decoder(SensorSize size) {
  return std::make_unique<Evt3Decoder>(size);
}

std::unique_ptr<Encoder> make_evt3_encoder(SensorSize size, std::string header) {
  return std::make_unique<WordEncoder<Evt3State>>(size, std::move(header));
}

}  // namespace eventcamera
