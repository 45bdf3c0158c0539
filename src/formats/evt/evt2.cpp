// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/evt2.hpp"

#include <algorithm>

#include "src/formats/evt/cd_reader.hpp"
#include "src/formats/evt/cd_word.hpp"
#include "src/formats/evt/high_time_writer.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

enum Type : std::uint32_t {
  cd_off = 0x0,
  cd_on = 0x1,
  time_high = 0x8,
  ext_trigger = 0xa,
  imu = 0xd,
  others = 0xe,
  continued = 0xf,
};

class Evt2Reader final : public CdReader {
 public:
  explicit Evt2Reader(SensorSize size) : CdReader(size) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; !time_.known() && to - from >= 4; from += 4)
      read_other(CdWord{load<std::uint32_t>(from)}, from, batch);
    auto* event = batch.begin();
    const auto* const end = from + 4 * std::min((to - from) / 4, batch.full() - event);
    const auto bounds = bounds_;
    auto time = time_.time();
    auto count = time_.count();
    std::uint64_t outside = 0;
    for (; from != end; from += 4) {
      const CdWord word{load<std::uint32_t>(from)};
      const bool is_event = word.type() <= cd_on;
      const bool is_time = word.type() == time_high && word.count() >= count;
      if (!(is_event || is_time)) [[unlikely]] {
        time_.follow(count);
        read_other(word, from, batch);
        time = time_.time();
        count = time_.count();
        continue;
      }
      // Events and times alternate as no processor can guess, so no branch tells them apart.
      const auto ticks = is_time ? word.count() - count : 0;
      time += std::uint64_t{ticks} << 6;
      count += ticks;
      const bool inside = bounds.contain(word.x(), word.y());
      *event = word.event(time, word.type() & 1);
      event += static_cast<int>(is_event) & static_cast<int>(inside);
      outside += static_cast<std::uint64_t>(static_cast<int>(is_event) & static_cast<int>(!inside));
    }
    if (time_.known()) time_.follow(count);
    batch.end = event;
    batch.outside(outside);
    return from;
  }

 private:
  /// All but an event or a time that goes on.
  void read_other(CdWord word, const std::uint8_t* at, Batch& batch) {
    switch (word.type()) {
      case time_high:
        time_.follow(word.count());
        break;
      case ext_trigger:
        read_trigger(word, batch);
        break;
      case cd_off:  // with a time that is not yet known
      case cd_on:
      case imu:
      case others:
      case continued:
        break;
      default:
        batch.bad(at, 4, "a word of a type that EVT2 does not have");
    }
  }
};

class Evt2Encoder final : public Encoder {
 public:
  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, WordWriter<std::uint32_t>& words) {
      for (const auto& event : few) {
        if (time_.is_new(event.t)) {
          time_.reach(event.t, words, words_at_once,
                      [](std::uint64_t count) { return CdWord::time_high(time_high, count).bits; });
        }
        words.put(CdWord::at(event.y_p >> 15, time_.written(event.t), event.x,
                             static_cast<std::uint32_t>(event.y()))
                      .bits);
      }
    };
    write_events<std::uint32_t>(events, words_at_once, out, write);
  }

  void finish(std::vector<std::uint8_t>&) override {}

 private:
  static constexpr std::size_t words_at_once = 2 * events_at_once;

  HighTimeWriter time_;
};

}  // namespace

std::unique_ptr<UnitReader> make_evt2_reader(SensorSize size) {
  return std::make_unique<Evt2Reader>(size);
}

std::unique_ptr<Encoder> make_evt2_encoder() {
  return std::make_unique<Evt2Encoder>();
}

}  // namespace eventcamera
