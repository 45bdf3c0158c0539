// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT2, EVT2.1 and EVT4, whose words are similar: an event, or a mask of 32 pixels of a row, with
// the low bits of its time; or the high bits of the time.
#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "src/formats/evt/cd_words.hpp"
#include "src/formats/evt/words.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

/// Base of the decoders; the only state is the time.
template <CdTypes types>
class CdDecoder : public UnitDecoder {
 public:
  State state() const override { return time_.state(); }
  void restore(const State& state) override { time_.restore(state); }

 protected:
  CdDecoder(SensorSize size, const char* unknown_type)
      : bounds_(size, max_evt_side), unknown_type_(unknown_type) {}

  /// Reads a word of size `bytes` without events.
  void read_other(CdWord word, const std::uint8_t* at, std::size_t bytes, Batch& batch) {
    if (word.type() == types.time_high) {
      if (!time_.follow(word.count())) batch.bad(at, bytes, time_falls);
    } else if (word.type() == types.trigger) {
      if (time_.known()) batch.triggers().push_back(word.trigger(time_.time()));
    } else if ((types.ignored >> word.type() & 1) == 0) {
      batch.bad(at, bytes, unknown_type_);
    }
  }

  /// Writes the events of a mask, starting at the pixel of `word`, if the time is known. Counts
  /// those outside the sensor. Returns the end of the written events.
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

/// Events with the same time, polarity and row, within 32 pixels from `base` on.
struct MaskedEvents {
  std::uint32_t base;
  std::uint32_t mask = 0;
  std::size_t count = 0;
};

/// Returns the events at the front that fit into one mask. As in words of sensors, masks start at
/// multiples of 32 and events are in order of columns.
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

/// Format::put() encodes the first of the given events, with at most two words per event, and
/// returns the number of encoded events.
template <class Format>
class CdState {
 public:
  using Word = typename Format::Word;
  using Words = WordWriter<Word>;

  static constexpr std::size_t words_at_once = 2 * events_at_once;
  static constexpr auto max_trigger_id = CdWord::max_trigger_id;

  explicit CdState(int width) : width_(static_cast<std::uint32_t>(width)) {}

  bool is_at(std::uint64_t time) const { return time >> 6 == time_high_; }

  void prepare(std::uint64_t time, Words& words) {
    if (!is_at(time)) [[unlikely]]
      put_time_high(time >> 6, words);
  }

  std::size_t write(std::span<const AbsoluteEvent> events, std::uint64_t time, Words& words) const {
    return Format::put(events, time, width_, words);
  }

  static void write_trigger(const Trigger& trigger, std::uint64_t time, Words& words) {
    words.put(Format::word(CdWord::of_trigger(Format::types.trigger, time, trigger)));
  }

 private:
  static constexpr int bits = 28;
  static constexpr std::uint64_t max_wraps = (GapLimiter::max_gap >> (bits + 6)) + 1;
  static constexpr std::uint64_t none = ~std::uint64_t{0};

  static Word time_high(std::uint64_t count) {
    return Format::word(CdWord::time_high(Format::types.time_high, count));
  }

  void put_time_high(std::uint64_t count, Words& words) {
    const bool first = time_high_ == none;
    if (Format::has_steady_time && !first)
      put_steps(count, words);
    else
      put_wraps(count, words);
    words.put(time_high(count));
    time_high_ = count;
  }

  /// Writes each wrap explicitly, because readers detect it by the fall from nearly the maximum
  /// count to nearly 0 (OpenEB allows 10 ms). Jumps are repeated, so that OpenEB's robust decoder
  /// accepts them.
  void put_wraps(std::uint64_t count, Words& words) {
    const auto wraps = (count >> bits) - (time_high_ == none ? 0 : time_high_ >> bits);
    if (wraps == 0 || wraps > max_wraps) [[likely]]
      return;
    constexpr auto last = (std::uint64_t{1} << bits) - 1;
    words.reserve(3 * wraps + 2 + words_at_once);
    for (std::uint64_t i = 0; i < wraps; ++i)
      for (const auto jump : {last, last, std::uint64_t{0}}) words.put(time_high(jump));
    words.put(time_high(count));
  }

  /// Fills a pause, so that consecutive TIME_HIGH are less than 1000 microseconds apart.
  void put_steps(std::uint64_t count, Words& words) {
    constexpr std::uint64_t step = 999 >> 6;
    constexpr auto max_steps = (GapLimiter::max_gap >> 6) / step + 1;
    const auto steps = (count - time_high_ - 1) / step;
    if (steps == 0 || steps > max_steps) [[likely]]
      return;
    words.reserve(steps + 1 + words_at_once);
    for (std::uint64_t i = 1; i <= steps; ++i) words.put(time_high(time_high_ + i * step));
  }

  std::uint32_t width_;
  std::uint64_t time_high_ = none;
};

/// Base of formats of 32-bit words.
template <CdTypes word_types>
struct ShortWords {
  using Word = std::uint32_t;

  static constexpr CdTypes types = word_types;
  static constexpr bool has_steady_time = false;

  static constexpr Word word(CdWord word) { return word.bits; }
};

/// An event or a TIME_HIGH.
struct Evt2 : ShortWords<evt2::types> {
  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         std::uint32_t /*width*/, WordWriter<Word>& words) {
    const auto& event = events.front();
    const auto y = static_cast<std::uint32_t>(event.y());
    words.put(CdWord::at(event.y_p >> 15, time, event.x, y).bits);
    return 1;
  }
};

class Evt2Decoder final : public CdDecoder<Evt2::types> {
 public:
  explicit Evt2Decoder(SensorSize size) : CdDecoder(size, "EVT2 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; !time_.known() && to - from >= 4; from += 4)
      read_other(CdWord{little_endian<std::uint32_t>(from)}, from, 4, batch);
    auto* event = batch.end;
    const auto* const end = from + 4 * std::min((to - from) / 4, batch.full() - event);
    const auto bounds = bounds_;
    auto time = time_.time();
    auto count = time_.count();
    auto small_step_end = time_.small_step_end();
    std::uint64_t outside = 0;
    for (; from != end; from += 4) {
      const CdWord word{little_endian<std::uint32_t>(from)};
      const bool is_event = word.type() <= evt2::cd_on;
      const bool is_time =
          word.type() == Evt2::types.time_high && word.count() - count < small_step_end;
      if (!(is_event || is_time)) [[unlikely]] {
        if (time != time_.time()) time_.advance_to(time);
        read_other(word, from, 4, batch);
        time = time_.time();
        count = time_.count();
        small_step_end = time_.small_step_end();
        continue;
      }
      // Branch-free, because events and times alternate unpredictably.
      const auto ticks = is_time ? word.count() - count : 0;
      time += std::uint64_t{ticks} << 6;
      count += ticks;
      const bool inside = bounds.contain(word.x(), word.y());
      *event = word.event(time);
      event += static_cast<int>(is_event) & static_cast<int>(inside);
      outside += static_cast<std::uint64_t>(static_cast<int>(is_event) & static_cast<int>(!inside));
    }
    if (time != time_.time()) time_.advance_to(time);
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

/// 64-bit words: the upper half as in EVT2, the lower half a mask. They are little-endian or, in
/// the legacy order of Gen4.1 and IMX636 cameras, the upper half first, each half little-endian.
template <EvtFormat format>
struct Evt21 {
  using Word = std::uint64_t;

  static constexpr CdTypes types = evt21::types;
  static constexpr bool has_steady_time = false;

  static constexpr Word word(CdWord upper, std::uint32_t lower = 0) {
    return evt21::in_order<format>(std::uint64_t{upper.bits} << 32 | lower);
  }

  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         std::uint32_t /*width*/, WordWriter<Word>& words) {
    const auto& first = events.front();
    const auto masked = first_masked(events);
    const auto y = static_cast<std::uint32_t>(first.y());
    words.put(word(CdWord::at(first.y_p >> 15, time, masked.base, y), masked.mask));
    return masked.count;
  }
};

template <EvtFormat format>
class Evt21Decoder final : public CdDecoder<evt21::types> {
 public:
  explicit Evt21Decoder(SensorSize size)
      : CdDecoder<evt21::types>(size, "EVT2.1 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.end;
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    for (; to - from >= 8 && event < full; from += 8) {
      const auto bits = evt21::in_order<format>(little_endian<std::uint64_t>(from));
      const CdWord upper{static_cast<std::uint32_t>(bits >> 32)};
      if (upper.type() <= evt2::cd_on)
        event = read_masked(upper, static_cast<std::uint32_t>(bits), event, outside);
      else
        read_other(upper, from, 8, batch);
    }
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

/// An event, a TIME_HIGH, or the start of a vector, whose second word is a mask.
struct Evt4 : ShortWords<evt4::types> {
  /// OpenEB's robust decoder drops events after a pause without TIME_HIGH.
  static constexpr bool has_steady_time = true;

  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         std::uint32_t width, WordWriter<Word>& words) {
    const auto& first = events.front();
    const auto masked = first_masked(events);
    const std::uint32_t on = first.y_p >> 15;
    const auto y = static_cast<std::uint32_t>(first.y());
    // A vector takes two words, like two events. OpenEB's robust decoder drops vectors with any of
    // the 32 pixels outside the sensor.
    if (masked.count > 2 && masked.base + 32 <= width) {
      words.put(CdWord::at(evt4::cd_vec_off + on, time, masked.base, y).bits);
      words.put(masked.mask);
    } else {
      for (const auto& event : events.first(masked.count))
        words.put(CdWord::at(evt4::cd_off + on, time, event.x, y).bits);
    }
    return masked.count;
  }
};

class Evt4Decoder final : public CdDecoder<Evt4::types> {
 public:
  explicit Evt4Decoder(SensorSize size) : CdDecoder(size, "EVT4 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.end;
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    for (; to - from >= 4 && event < full; from += 4) {
      const CdWord word{little_endian<std::uint32_t>(from)};
      switch (word.type()) {
        case evt4::cd_off:
        case evt4::cd_on:
          if (time_.known()) {
            const bool inside = bounds_.contain(word.x(), word.y());
            *event = word.event(time_.time());
            event += static_cast<int>(inside);
            outside += static_cast<std::uint64_t>(!inside);
          }
          continue;
        case evt4::cd_vec_off:
        case evt4::cd_vec_on:
          // Both words of a vector are one unit.
          if (to - from < 8) break;
          from += 4;
          event = read_masked(word, little_endian<std::uint32_t>(from), event, outside);
          continue;
        default:
          read_other(word, from, 4, batch);
          continue;
      }
      break;
    }
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

}  // namespace

std::unique_ptr<UnitDecoder> make_evt_unit_decoder(EvtFormat format, SensorSize size) {
  switch (format) {
    case EvtFormat::evt2:
      return std::make_unique<Evt2Decoder>(size);
    case EvtFormat::evt21:
      return std::make_unique<Evt21Decoder<EvtFormat::evt21>>(size);
    case EvtFormat::evt21_legacy:
      return std::make_unique<Evt21Decoder<EvtFormat::evt21_legacy>>(size);
    case EvtFormat::evt3:
      return make_evt3_unit_decoder(size);
    case EvtFormat::evt4:
      return std::make_unique<Evt4Decoder>(size);
  }
  throw std::invalid_argument("unknown EVT format");
}

std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size, std::string header) {
  if (size.width < 1 || size.height < 1 || size.width > max_evt_side || size.height > max_evt_side)
    throw std::invalid_argument("EVT words support sensors of 1x1 to 2048x2048 pixels");
  switch (format) {
    case EvtFormat::evt2:
      return std::make_unique<WordEncoder<CdState<Evt2>>>(size, std::move(header));
    case EvtFormat::evt21:
      return std::make_unique<WordEncoder<CdState<Evt21<EvtFormat::evt21>>>>(size,
                                                                             std::move(header));
    case EvtFormat::evt21_legacy:
      return std::make_unique<WordEncoder<CdState<Evt21<EvtFormat::evt21_legacy>>>>(
          size, std::move(header));
    case EvtFormat::evt3:
      return make_evt3_encoder(size, std::move(header));
    case EvtFormat::evt4:
      return std::make_unique<WordEncoder<CdState<Evt4>>>(size, std::move(header));
  }
  throw std::invalid_argument("unknown EVT format");
}

}  // namespace eventcamera
