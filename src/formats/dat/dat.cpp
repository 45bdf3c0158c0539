// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/dat/dat.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "src/formats/prophesee_header.hpp"
#include "src/formats/time_base.hpp"
#include "src/formats/unit_decoder.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

/// Columns and rows have 14 bits.
constexpr int max_side = 16384;

enum Type : std::uint8_t { event_2d = 0x00, event_cd = 0x0c, event_trigger = 0x0e };

constexpr std::uint8_t record_size = 8;

class DatReader : public UnitReader {
 public:
  State state() const final { return {static_cast<Microseconds>(time_.time()), 0}; }
  void restore(const State& state) final { time_.restore(state.clock, true); }

 protected:
  using Time = TimeBase<32, 0>;

  static Microseconds next(Time& time, const std::uint8_t* record) {
    time.follow(little_endian<std::uint32_t>(record));
    return static_cast<Microseconds>(time.time());
  }

  Time time_;
};

template <int version>
class DatEventReader final : public DatReader {
 public:
  explicit DatEventReader(SensorSize size) : bounds_(size, max_side) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.begin();
    const auto* const end =
        from + record_size * std::min((to - from) / record_size, batch.full() - event);
    const auto bounds = bounds_;
    auto time = time_;
    std::uint64_t outside = 0;
    for (; from != end; from += record_size) {
      const auto t = next(time, from);
      const auto word = little_endian<std::uint32_t>(from + 4);
      const auto x = version == 1 ? word & 0x1ff : word & 0x3fff;
      const auto y = version == 1 ? word >> 9 & 0xff : word >> 14 & 0x3fff;
      const bool on = version == 1 ? (word >> 17 & 1) != 0 : word >> 28 != 0;
      *event = {t, static_cast<std::uint16_t>(x),
                static_cast<std::uint16_t>(y | static_cast<std::uint32_t>(on) << 15)};
      const bool inside = bounds.contain(x, y);
      event += static_cast<int>(inside);
      outside += static_cast<std::uint64_t>(!inside);
    }
    time_ = time;
    batch.end = event;
    batch.outside(outside);
    return from;
  }

 private:
  Bounds bounds_;
};

class DatTriggerReader final : public DatReader {
  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; to - from >= record_size; from += record_size) {
      const auto t = next(time_, from);
      const auto word = little_endian<std::uint32_t>(from + 4);
      batch.triggers->push_back({t, static_cast<std::uint16_t>(word >> 26), (word & 15) != 0});
    }
    return from;
  }
};

/// Ignores "T0", which some writers add: the time of the first event since some epoch.
class DatDecoder final : public UnitDecoder {
 private:
  std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended) override {
    if (!header_.ended()) {
      const auto taken = header_.take(bytes, ended);
      if (!header_.ended() || taken != 0) return taken;
    }
    if (!header_.found()) throw UnsupportedFormat("not a DAT file: no header");
    if (bytes.size() < 2) return 0;
    begin_records(bytes[0], bytes[1]);
    return 2;
  }

  void begin_records(std::uint8_t type, std::uint8_t bytes) {
    if (!header_.value("evt").empty() || header_.value("format").starts_with("EVT"))
      throw UnsupportedFormat("not a DAT file but RAW; use evtdec");
    if (bytes != record_size)
      throw UnsupportedFormat("unsupported DAT event size of " + std::to_string(bytes) + " bytes");
    // Files without a version predate version numbers.
    const auto version = header_.value("Version");
    if (version != "2" && version != "1" && !version.empty())
      throw UnsupportedFormat("unsupported DAT version '" + version + "'");
    SensorSize size{PropheseeHeader::number(header_.value("Width"), max_side),
                    PropheseeHeader::number(header_.value("Height"), max_side)};
    if (size.width == 0 || size.height == 0) size = version == "2" ? SensorSize{} : first_camera;
    if (type == event_trigger)
      begin(std::make_unique<DatTriggerReader>(), size);
    else if (type != event_2d && type != event_cd)
      throw UnsupportedFormat("unsupported DAT event type " + std::to_string(type));
    else if (version == "2")
      begin(std::make_unique<DatEventReader<2>>(size), size);
    else
      begin(std::make_unique<DatEventReader<1>>(size), size);
  }

  /// Sensor of the first camera, whose files do not state the size.
  static constexpr SensorSize first_camera{304, 240};

  PropheseeHeader header_;
};

class DatEncoder final : public Encoder {
 public:
  explicit DatEncoder(SensorSize size)
      : Encoder("% Data file containing CD events.\n% Version 2\n% Height " +
                std::to_string(size.height) + "\n% Width " + std::to_string(size.width) +
                "\n% end\n" + static_cast<char>(event_cd) + static_cast<char>(record_size)) {}

 private:
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    const auto write = [](std::span<const AbsoluteEvent> few, WordWriter<std::uint64_t>& words) {
      for (const auto& event : few) {
        const auto place = (std::uint32_t{event.x} & 0x3fff) |
                           (static_cast<std::uint32_t>(event.y_p) & 0x3fff) << 14 |
                           static_cast<std::uint32_t>(event.y_p >> 15) << 28;
        words.put(std::uint64_t{place} << 32 | static_cast<std::uint32_t>(event.t));
      }
    };
    write_events<std::uint64_t>(events, events_at_once, out, write);
  }
};

}  // namespace

std::unique_ptr<Decoder> make_dat_decoder() {
  return std::make_unique<DatDecoder>();
}

std::unique_ptr<Encoder> make_dat_encoder(SensorSize size) {
  if (size.width < 1 || size.height < 1 || size.width > max_side || size.height > max_side)
    throw std::invalid_argument("DAT files support sensors of 1x1 to 16384x16384 pixels");
  return std::make_unique<DatEncoder>(size);
}

}  // namespace eventcamera
