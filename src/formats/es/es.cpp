// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/es/es.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>

#include "src/core/sensor_size.hpp"
#include "src/formats/unit_stream_decoder.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

constexpr std::string_view magic = "Event Stream";
constexpr std::uint8_t version = 2;
constexpr std::size_t header_size = magic.size() + 3 + 1 + 4;

enum Type : std::uint8_t { generic = 0, dvs = 1, atis = 2, amd = 3, colour = 4 };

/// Converts between rows counted from the top and rows of the file.
class Rows {
 public:
  Rows(int height, EsOrigin origin)
      : first_(origin == EsOrigin::bottom_left ? height - 1 : 0),
        step_(origin == EsOrigin::bottom_left ? -1 : 1) {}

  int operator()(int row) const { return first_ + step_ * row; }

 private:
  int first_;
  int step_;
};

/// Base of the decoders; the only state is the time.
class EsEventDecoder : public UnitDecoder {
 public:
  EsEventDecoder(SensorSize size, EsOrigin origin)
      : bounds_(size, max_side), rows_(size.height, origin) {}

  State state() const override { return {static_cast<Microseconds>(t_), 0}; }
  void restore(const State& state) override { t_ = static_cast<std::uint64_t>(state.clock); }

 protected:
  Bounds bounds_;
  Rows rows_;
  std::uint64_t t_ = 0;
};

/// An event is a byte with the microseconds since the last event and `flag_bits` flags, followed by
/// x and y with 16 bits each. If all bits of the microseconds are set, it is that byte alone.
template <int flag_bits>
class EsPolarityDecoder final : public EsEventDecoder {
 public:
  using EsEventDecoder::EsEventDecoder;

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    constexpr std::uint32_t max_step = 0xff >> flag_bits;
    constexpr std::uint32_t flags = (1 << flag_bits) - 1;
    // An ATIS event with bit 0 set is the start or end of an exposure.
    constexpr std::uint32_t exposure = flag_bits == 2 ? 1 : 0;
    constexpr std::uint32_t on = flag_bits == 2 ? 2 : 1;
    auto* event = batch.end;
    const auto* const full = batch.full();
    const auto rows = rows_;
    auto t = t_;
    std::uint64_t outside = 0;
    std::uint64_t exposures = 0;
    while (from < to && event < full) {
      const std::uint32_t byte = *from;
      const auto step = byte >> flag_bits;
      if (step == max_step) {
        // The flags are the number of maximum steps; readers may ignore 0.
        t += static_cast<std::uint64_t>(max_step) * (byte & flags);
        ++from;
        continue;
      }
      if (to - from < 5) break;
      t += step;
      const auto x = little_endian<std::uint16_t>(from + 1);
      const auto row = static_cast<std::uint32_t>(rows(little_endian<std::uint16_t>(from + 3)));
      from += 5;
      const auto inside = static_cast<int>(bounds_.contain(x, row));
      const auto is_change = static_cast<int>((byte & exposure) == 0);
      *event = {static_cast<Microseconds>(t), x,
                static_cast<std::uint16_t>(row | ((byte & on) != 0 ? 0x8000 : 0))};
      event += is_change & inside;
      outside += static_cast<std::uint64_t>(is_change & ~inside);
      exposures += static_cast<std::uint64_t>(1 - is_change);
    }
    t_ = t;
    batch.end = event;
    batch.outside(outside);
    batch.skipped(exposures);
    return from;
  }
};

/// An event is a byte with the microseconds since the last event, x and y with 16 bits each, and
/// red, green and blue. The two largest numbers are a byte alone. A change of colour has no
/// polarity: it is ON, and its colour is skipped.
class EsColourDecoder final : public EsEventDecoder {
 public:
  using EsEventDecoder::EsEventDecoder;

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    constexpr std::uint8_t reset = 0xfe;
    constexpr std::uint8_t overflow = 0xff;
    constexpr std::ptrdiff_t event_size = 8;
    while (from < to && batch.end < batch.full()) {
      if (*from >= reset) {
        if (*from == overflow) t_ += reset;
        ++from;
        continue;
      }
      if (to - from < event_size) break;
      t_ += *from;
      const auto x = little_endian<std::uint16_t>(from + 1);
      const auto row = static_cast<std::uint32_t>(rows_(little_endian<std::uint16_t>(from + 3)));
      from += event_size;
      if (!bounds_.contain(x, row)) {
        batch.outside(1);
        continue;
      }
      *batch.end++ = {static_cast<Microseconds>(t_), x, static_cast<std::uint16_t>(row | 0x8000)};
      batch.skipped(1);
    }
    return from;
  }
};

class EsDecoder final : public UnitStreamDecoder {
 public:
  explicit EsDecoder(EsOrigin origin) : origin_(origin) {}

 private:
  std::size_t read_header(std::span<const std::uint8_t> bytes, bool) override {
    const auto known = std::min(bytes.size(), magic.size());
    if (!std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(known),
                    magic.begin()))
      throw UnsupportedFormat("not an Event Stream: wrong signature");
    if (bytes.size() < header_size) return 0;
    const auto* at = bytes.data() + magic.size();
    if (at[0] != version)
      throw UnsupportedFormat("unsupported Event Stream version " + std::to_string(at[0]) + "." +
                              std::to_string(at[1]));
    const SensorSize size{little_endian<std::uint16_t>(at + 4),
                          little_endian<std::uint16_t>(at + 6)};
    switch (at[3]) {
      case dvs:
        begin_events<EsPolarityDecoder<1>>(size);
        break;
      case atis:
        begin_events<EsPolarityDecoder<2>>(size);
        break;
      case generic:
        throw UnsupportedFormat(
            "unsupported Event Stream of generic events: they have no pixels, and only the program "
            "that wrote them knows what their bytes mean. Export them with that program, such as "
            "to text of the columns t, x, y, p");
      case colour:
        begin_events<EsColourDecoder>(size);
        break;
      default:
        throw UnsupportedFormat("unsupported Event Stream type " + std::to_string(at[3]));
    }
    return header_size;
  }

  template <class DvsDecoder>
  void begin_events(SensorSize size) {
    if (!is_side(size.width) || !is_side(size.height))
      throw UnsupportedFormat("Event Stream with an impossible sensor size of " + in_pixels(size));
    begin(std::make_unique<DvsDecoder>(size, origin_), size);
  }

  EsOrigin origin_;
};

/// Low and high byte of a number in the header.
constexpr char low(int number) {
  return static_cast<char>(number & 255);
}
constexpr char high(int number) {
  return static_cast<char>(number >> 8);
}

class EsEncoder final : public Encoder {
 public:
  EsEncoder(SensorSize size, EsOrigin origin)
      : Encoder(std::string(magic) + std::string{version, 0, 0, dvs, low(size.width),
                                                 high(size.width), low(size.height),
                                                 high(size.height)}),
        rows_(size.height, origin) {}

  std::uint64_t removed_time() const override { return gaps_.removed_time(); }

 private:
  static constexpr std::size_t bytes_at_once = 5 * events_at_once;
  static constexpr std::uint32_t max_step = 127;

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [&](std::span<const AbsoluteEvent> few, WordWriter<std::uint8_t>& bytes) {
      for (const auto& event : few) {
        const auto step = advance_to(event.t, bytes);
        const auto x = std::uint32_t{event.x};
        const auto y = static_cast<std::uint32_t>(rows_(event.y()));
        const auto on = static_cast<std::uint32_t>(event.y_p >> 15);
        for (const auto byte : {step << 1 | on, x & 255, x >> 8, y & 255, y >> 8})
          bytes.put(static_cast<std::uint8_t>(byte));
      }
    };
    write_events<std::uint8_t>(events, bytes_at_once, out, write);
  }

  /// Fills the pause before an event, and returns the rest of it.
  std::uint32_t advance_to(Microseconds t, WordWriter<std::uint8_t>& bytes) {
    // Clamps decreasing times, because the format has no steps backwards.
    t = std::max(t, last_);
    last_ = t;
    gaps_.advance_to(t);
    auto step = gaps_.written(t) - written_;
    written_ += step;
    if (step >= max_step) [[unlikely]] {
      bytes.reserve(step / max_step + bytes_at_once);
      for (; step >= max_step; step -= max_step) bytes.put(0xff);
    }
    return static_cast<std::uint32_t>(step);
  }

  Rows rows_;
  GapLimiter gaps_;
  Microseconds last_ = 0;
  std::uint64_t written_ = 0;  // time of the last byte
};

}  // namespace

std::unique_ptr<EventDecoder> make_event_stream_decoder(EsOrigin origin) {
  return std::make_unique<EsDecoder>(origin);
}

std::unique_ptr<Encoder> make_event_stream_encoder(SensorSize size, EsOrigin origin) {
  if (!is_side(size.width) || !is_side(size.height))
    throw std::invalid_argument("Event Streams support sensors of 1x1 to 16384x16384 pixels");
  return std::make_unique<EsEncoder>(size, origin);
}

}  // namespace eventcamera
