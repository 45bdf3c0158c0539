// SPDX-License-Identifier: LGPL-2.1-or-later
// EVT2: words of 32 bits, each an event, or the high bits of the time.
#include <algorithm>

#include "src/formats/evt/words.hpp"

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

/// An event is one of these only before the time is known.
constexpr auto ignored = 1U << cd_off | 1U << cd_on | 1U << imu | 1U << others | 1U << continued;

class Evt2Reader final : public CdReader<CdTypes{time_high, ext_trigger, ignored}> {
 public:
  explicit Evt2Reader(SensorSize size) : CdReader(size, "EVT2 word of unknown type") {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; !time_.known() && to - from >= 4; from += 4)
      read_other(CdWord{little_endian<std::uint32_t>(from)}, from, 4, batch);
    auto* event = batch.begin();
    const auto* const end = from + 4 * std::min((to - from) / 4, batch.full() - event);
    const auto bounds = bounds_;
    auto time = time_.time();
    auto count = time_.count();
    std::uint64_t outside = 0;
    for (; from != end; from += 4) {
      const CdWord word{little_endian<std::uint32_t>(from)};
      const bool is_event = word.type() <= cd_on;
      const bool is_time = word.type() == time_high && word.count() >= count;
      if (!(is_event || is_time)) [[unlikely]] {
        time_.follow(count);
        read_other(word, from, 4, batch);
        time = time_.time();
        count = time_.count();
        continue;
      }
      // Events and times alternate as no processor can guess, so no branch tells them apart.
      const auto ticks = is_time ? word.count() - count : 0;
      time += std::uint64_t{ticks} << 6;
      count += ticks;
      const bool inside = bounds.contain(word.x(), word.y());
      *event = word.event(time);
      event += static_cast<int>(is_event) & static_cast<int>(inside);
      outside += static_cast<std::uint64_t>(static_cast<int>(is_event) & static_cast<int>(!inside));
    }
    if (time_.known()) time_.follow(count);
    batch.end = event;
    batch.outside(outside);
    return from;
  }
};

struct Evt2Format {
  using Word = std::uint32_t;

  static Word time_high(std::uint64_t count) {
    return CdWord::time_high(Type::time_high, count).bits;
  }

  static std::size_t put(std::span<const AbsoluteEvent> events, std::uint64_t time,
                         WordWriter<Word>& words) {
    const auto& event = events.front();
    const auto y = static_cast<std::uint32_t>(event.y());
    words.put(CdWord::at(event.y_p >> 15, time, event.x, y).bits);
    return 1;
  }
};

}  // namespace

std::unique_ptr<UnitReader> make_evt2_reader(SensorSize size) {
  return std::make_unique<Evt2Reader>(size);
}

std::unique_ptr<Encoder> make_evt2_encoder(std::string header) {
  return std::make_unique<CdEncoder<Evt2Format>>(std::move(header));
}

}  // namespace eventcamera
