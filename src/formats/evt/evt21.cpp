// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT2.1: words of 64 bits, each up to 32 events of a row, or the high bits of the time.
#include "src/formats/evt/words.hpp"

namespace eventcamera {
namespace {

/// In the upper half of a word, whose other bits are as in a word of EVT2.
enum Type : std::uint32_t {
  cd_off = 0x0,
  cd_on = 0x1,
  time_high = 0x8,
  ext_trigger = 0xa,
  others = 0xe,
  continued = 0xf,
};

template <Evt21Order order>
constexpr std::uint64_t in_order(std::uint64_t word) {
  return order == Evt21Order::little ? word : std::rotl(word, 32);
}

using Evt21WordReader = CdReader<CdTypes{time_high, ext_trigger, 1U << others | 1U << continued}>;

template <Evt21Order order>
class Evt21Reader final : public Evt21WordReader {
 public:
  explicit Evt21Reader(SensorSize size) : Evt21WordReader(size, "EVT2.1 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.begin();
    const auto* const full = batch.full();
    std::uint64_t outside = 0;
    for (; to - from >= 8 && event < full; from += 8) {
      const auto bits = in_order<order>(little_endian<std::uint64_t>(from));
      const CdWord upper{static_cast<std::uint32_t>(bits >> 32)};
      if (upper.type() <= cd_on)
        event = read_masked(upper, static_cast<std::uint32_t>(bits), event, outside);
      else
        read_other(upper, from, 8, batch);
    }
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

template <Evt21Order order>
struct Evt21Format {
  using Word = std::uint64_t;

  static Word time_high(std::uint64_t count) {
    return word(CdWord::time_high(Type::time_high, count), 0);
  }

  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         WordWriter<Word>& words) {
    const auto& first = events.front();
    const auto masked = first_masked(events);
    const auto y = static_cast<std::uint32_t>(first.y());
    words.put(word(CdWord::at(first.y_p >> 15, time, masked.base, y), masked.mask));
    return masked.count;
  }

 private:
  static constexpr Word word(CdWord upper, std::uint32_t lower) {
    return in_order<order>(std::uint64_t{upper.bits} << 32 | lower);
  }
};

}  // namespace

std::unique_ptr<UnitReader> make_evt21_reader(Evt21Order order, SensorSize size) {
  if (order == Evt21Order::little) return std::make_unique<Evt21Reader<Evt21Order::little>>(size);
  return std::make_unique<Evt21Reader<Evt21Order::legacy>>(size);
}

std::unique_ptr<Encoder> make_evt21_encoder(Evt21Order order, std::string header) {
  if (order == Evt21Order::little)
    return std::make_unique<CdEncoder<Evt21Format<Evt21Order::little>>>(std::move(header));
  return std::make_unique<CdEncoder<Evt21Format<Evt21Order::legacy>>>(std::move(header));
}

}  // namespace eventcamera
