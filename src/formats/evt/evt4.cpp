// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT4: words of 32 bits, each an event, the high bits of the time, or the head of a vector, whose
// second word is a mask of 32 pixels of a row.
#include "src/formats/evt/words.hpp"

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

constexpr auto ignored = 1U << others | 1U << continued | 1U << padding;

class Evt4Reader final : public CdReader<CdTypes{time_high, ext_trigger, ignored}> {
 public:
  explicit Evt4Reader(SensorSize size) : CdReader(size, "EVT4 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.begin();
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    for (; to - from >= 4 && event < full; from += 4) {
      const CdWord word{little_endian<std::uint32_t>(from)};
      switch (word.type()) {
        case cd_off:
        case cd_on:
          if (time_.known()) {
            const bool inside = bounds_.contain(word.x(), word.y());
            *event = word.event(time_.time());
            event += static_cast<int>(inside);
            outside += static_cast<std::uint64_t>(!inside);
          }
          continue;
        case cd_vec_off:
        case cd_vec_on:
          // A vector is one unit, so that nothing comes between its words.
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

struct Evt4Format {
  using Word = std::uint32_t;

  static Word time_high(std::uint64_t count) {
    return CdWord::time_high(Type::time_high, count).bits;
  }

  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         WordWriter<Word>& words) {
    const auto& first = events.front();
    const auto masked = first_masked(events);
    const std::uint32_t on = first.y_p >> 15;
    const auto y = static_cast<std::uint32_t>(first.y());
    // A vector is two words, as two events are.
    if (masked.count > 2) {
      words.put(CdWord::at(cd_vec_off + on, time, masked.base, y).bits);
      words.put(masked.mask);
    } else {
      words.put(CdWord::at(cd_off + on, time, first.x, y).bits);
      if (masked.count == 2) words.put(CdWord::at(cd_off + on, time, events[1].x, y).bits);
    }
    return masked.count;
  }
};

}  // namespace

std::unique_ptr<UnitReader> make_evt4_reader(SensorSize size) {
  return std::make_unique<Evt4Reader>(size);
}

std::unique_ptr<Encoder> make_evt4_encoder(std::string header) {
  return std::make_unique<CdEncoder<Evt4Format>>(std::move(header));
}

}  // namespace eventcamera
