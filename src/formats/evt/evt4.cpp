// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/evt4.hpp"

#include <algorithm>
#include <bit>

#include "src/formats/evt/cd_reader.hpp"
#include "src/formats/evt/cd_word.hpp"
#include "src/formats/evt/high_time_writer.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

enum Type : std::uint32_t {
  others = 0x6,
  continued = 0x7,
  ext_trigger = 0x9,
  cd_off = 0xa,
  cd_on = 0xb,
  cd_vec_off = 0xc,
  cd_vec_on = 0xd,
  time_high = 0xe,
  padding = 0xf,
};

class Evt4Reader final : public CdReader {
 public:
  explicit Evt4Reader(SensorSize size) : CdReader(size) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.begin();
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    // A vector is one unit, so that nothing is between its words.
    for (; to - from >= 4 && event < full; from += 4) {
      const CdWord word{load<std::uint32_t>(from)};
      switch (word.type()) {
        case cd_off:
        case cd_on:
          if (time_.known()) {
            const bool inside = bounds_.contain(word.x(), word.y());
            *event = word.event(time_.time(), word.type() & 1);
            event += static_cast<int>(inside);
            outside += static_cast<std::uint64_t>(!inside);
          }
          break;
        case cd_vec_off:
        case cd_vec_on: {
          if (to - from < 8) {
            batch.end = event;
            batch.outside(outside);
            return from;
          }
          from += 4;
          if (!time_.known()) break;
          const auto mask = load<std::uint32_t>(from);
          const auto valid = bounds_.of_32(word.x(), word.y());
          event = expand(mask & valid, word.event(time_.time(), word.type() & 1), event);
          outside += static_cast<std::uint64_t>(std::popcount(mask & ~valid));
          break;
        }
        case time_high:
          time_.follow(word.count());
          break;
        case ext_trigger:
          read_trigger(word, batch);
          break;
        case others:
        case continued:
        case padding:
          break;
        default:
          batch.bad(from, 4, "a word of a type that EVT4 does not have");
      }
    }
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

class Evt4Encoder final : public Encoder {
 public:
  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, WordWriter<std::uint32_t>& words) {
      while (!few.empty()) {
        const auto& first = few.front();
        if (time_.is_new(first.t)) {
          time_.reach(first.t, words, words_at_once,
                      [](std::uint64_t count) { return CdWord::time_high(time_high, count).bits; });
        }
        const auto masked = first_masked(few);
        const std::uint32_t on = first.y_p >> 15;
        const auto y = static_cast<std::uint32_t>(first.y());
        const auto time = time_.written(first.t);
        // A vector is two words.
        if (masked.count > 2) {
          words.put(CdWord::at(cd_vec_off + on, time, masked.base, y).bits);
          words.put(masked.mask);
        } else {
          for (const auto& event : few.first(masked.count))
            words.put(CdWord::at(cd_off + on, time, event.x, y).bits);
        }
        few = few.subspan(masked.count);
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

std::unique_ptr<UnitReader> make_evt4_reader(SensorSize size) {
  return std::make_unique<Evt4Reader>(size);
}

std::unique_ptr<Encoder> make_evt4_encoder() {
  return std::make_unique<Evt4Encoder>();
}

}  // namespace eventcamera
