// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/evt21.hpp"

#include <algorithm>
#include <bit>

#include "src/formats/evt/cd_reader.hpp"
#include "src/formats/evt/cd_word.hpp"
#include "src/formats/evt/high_time_writer.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

/// In the upper half of a word, which else is as a word of EVT2.
enum Type : std::uint32_t {
  cd_neg = 0x0,
  cd_pos = 0x1,
  time_high = 0x8,
  ext_trigger = 0xa,
  others = 0xe,
  continued = 0xf,
};

template <Evt21Order order>
constexpr std::uint64_t in_order(std::uint64_t word) {
  return order == Evt21Order::little ? word : std::rotl(word, 32);
}

template <Evt21Order order>
class Evt21Reader final : public CdReader {
 public:
  explicit Evt21Reader(SensorSize size) : CdReader(size) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.begin();
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    for (; to - from >= 8 && event < full; from += 8) {
      const auto bits = in_order<order>(load<std::uint64_t>(from));
      const CdWord upper{static_cast<std::uint32_t>(bits >> 32)};
      const auto lower = static_cast<std::uint32_t>(bits);
      switch (upper.type()) {
        case cd_neg:
        case cd_pos:
          if (time_.known()) {
            const auto valid = bounds_.of_32(upper.x(), upper.y());
            event = expand(lower & valid, upper.event(time_.time(), upper.type()), event);
            outside += static_cast<std::uint64_t>(std::popcount(lower & ~valid));
          }
          break;
        case time_high:
          time_.follow(upper.count());
          break;
        case ext_trigger:
          read_trigger(upper, batch);
          break;
        case others:
        case continued:
          break;
        default:
          batch.bad(from, 8, "a word of a type that EVT2.1 does not have");
      }
    }
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

template <Evt21Order order>
class Evt21Encoder final : public Encoder {
 public:
  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, WordWriter<std::uint64_t>& words) {
      while (!few.empty()) {
        const auto& first = few.front();
        if (time_.is_new(first.t)) {
          time_.reach(first.t, words, words_at_once, [](std::uint64_t count) {
            return word(CdWord::time_high(time_high, count), 0);
          });
        }
        const auto masked = first_masked(few);
        words.put(word(CdWord::at(first.y_p >> 15, time_.written(first.t), masked.base,
                                  static_cast<std::uint32_t>(first.y())),
                       masked.mask));
        few = few.subspan(masked.count);
      }
    };
    write_events<std::uint64_t>(events, words_at_once, out, write);
  }

  void finish(std::vector<std::uint8_t>&) override {}

 private:
  static constexpr std::size_t words_at_once = 2 * events_at_once;

  static constexpr std::uint64_t word(CdWord upper, std::uint32_t lower) {
    return in_order<order>(std::uint64_t{upper.bits} << 32 | lower);
  }

  HighTimeWriter time_;
};

}  // namespace

std::unique_ptr<UnitReader> make_evt21_reader(Evt21Order order, SensorSize size) {
  if (order == Evt21Order::little) return std::make_unique<Evt21Reader<Evt21Order::little>>(size);
  return std::make_unique<Evt21Reader<Evt21Order::legacy>>(size);
}

std::unique_ptr<Encoder> make_evt21_encoder(Evt21Order order) {
  if (order == Evt21Order::little) return std::make_unique<Evt21Encoder<Evt21Order::little>>();
  return std::make_unique<Evt21Encoder<Evt21Order::legacy>>();
}

}  // namespace eventcamera
