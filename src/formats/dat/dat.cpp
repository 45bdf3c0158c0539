// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/dat/dat.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "src/core/sensor_size.hpp"
#include "src/formats/prophesee_header.hpp"
#include "src/formats/unit_stream_decoder.hpp"
#include "src/formats/unwrapped_clock.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {
namespace {

static_assert(max_side == 1 << 14);  // columns and rows have 14 bits

enum Type : std::uint8_t { event_2d = 0x00, event_cd = 0x0c, event_trigger = 0x0e };

constexpr std::uint8_t record_size = 8;

using DatTime = UnwrappedClock<32>;

class DatRecordDecoder : public UnitDecoder {
 public:
  State state() const final { return {time_.time(), 0}; }
  void restore(const State& state) final { time_.restore(state.clock); }

 protected:
  static Microseconds next(DatTime& time, const std::uint8_t* record) {
    return time.follow(little_endian<std::uint32_t>(record));
  }

  DatTime time_;
};

template <int version>
class DatEventDecoder final : public DatRecordDecoder {
 public:
  explicit DatEventDecoder(SensorSize size) : bounds_(size, max_side) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    auto* event = batch.end;
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

class DatTriggerDecoder final : public DatRecordDecoder {
 public:
  explicit DatTriggerDecoder(SensorSize /*size*/) {}

  const std::uint8_t* read(const std::uint8_t* from, const std::uint8_t* to,
                           Batch& batch) override {
    for (; to - from >= record_size; from += record_size) {
      const auto t = next(time_, from);
      const auto word = little_endian<std::uint32_t>(from + 4);
      batch.triggers().push_back({t, static_cast<std::uint16_t>(word >> 26), (word & 15) != 0});
    }
    return from;
  }
};

/// Ignores "T0", which some writers add: the time of the first event since some epoch.
class DatDecoder final : public UnitStreamDecoder {
 public:
  void decode_tail(ByteSource& source, Decoded& out) const override {
    if (make_decoder_ == nullptr || source.size() < units_begin()) return;
    const auto count = (source.size() - units_begin()) / record_size;
    const auto last = std::min<std::uint64_t>(count, tail_size / record_size);
    const auto decoder = make_decoder_(size());
    decoder->restore({time_before(source, count - last), 0});
    std::vector<std::uint8_t> bytes(last * record_size);
    const auto begin = units_begin() + (count - last) * record_size;
    if (source.read(begin, bytes) != bytes.size()) return;
    Corruption ignored;
    Batch batch(ignored);
    for (std::span<const std::uint8_t> rest = bytes; !rest.empty();)
      rest = rest.subspan(decoder->decode(rest, begin, batch, out));
  }

 private:
  using MakeDecoder = std::unique_ptr<UnitDecoder> (*)(SensorSize size);

  /// Time of the record before this one. Wraps are counted by sampling a few earlier records, which
  /// must be less than about half an hour apart.
  Microseconds time_before(ByteSource& source, std::uint64_t record) const {
    constexpr std::uint64_t max_samples = 256;
    const auto samples = std::min(record, max_samples);
    DatTime time;
    for (std::uint64_t i = 1; i <= samples; ++i) {
      const auto sample = record - 1 - (samples - i) * (record / samples);
      const auto at = units_begin() + sample * record_size;
      std::array<std::uint8_t, 4> bytes{};
      if (source.read(at, bytes) != bytes.size()) break;
      time.follow(little_endian<std::uint32_t>(bytes.data()));
    }
    return time.time();
  }

  std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended) override {
    if (!header_.ended()) {
      const auto length = header_.read_line(bytes, ended);
      if (!header_.ended() || length != 0) return length;
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
    if (type != event_trigger && type != event_2d && type != event_cd)
      throw UnsupportedFormat("unsupported DAT event type " + std::to_string(type));
    make_decoder_ = type == event_trigger ? make<DatTriggerDecoder>
                    : version == "2"      ? make<DatEventDecoder<2>>
                                          : make<DatEventDecoder<1>>;
    begin(make_decoder_(size), size);
  }

  template <class RecordDecoder>
  static std::unique_ptr<UnitDecoder> make(SensorSize size) {
    return std::make_unique<RecordDecoder>(size);
  }

  /// Sensor of the first camera, whose files do not state the size.
  static constexpr SensorSize first_camera{304, 240};

  PropheseeHeader header_;
  MakeDecoder make_decoder_ = nullptr;  ///< for the records; set once the header is read
};

/// Converts times to the lower 32 bits that are written. Readers detect a wrap by a decrease of
/// more than half the range. Removes pauses that this cannot represent, and a first time beyond 32
/// bits.
class DatClock {
 public:
  std::uint32_t written(Microseconds t) {
    const auto gap = static_cast<std::uint64_t>(t) - static_cast<std::uint64_t>(last_);
    if (t > last_ && gap > half) [[unlikely]]
      remove_pause(t, gap);
    begun_ = true;
    last_ = t;
    return at(t);
  }

  std::uint64_t removed_time() const { return removed_; }

 private:
  static constexpr std::uint64_t half = 0x7fff'ffff;

  std::uint32_t at(Microseconds t) const {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(t) - shift_);
  }

  void remove_pause(Microseconds t, std::uint64_t gap) {
    const auto max_gap = begun_ ? DatTime::max_rise : DatTime::range - 1;
    if (gap <= max_gap && at(t) > at(last_)) return;  // no wrap
    shift_ += gap;
    if (begun_) removed_ += gap;
  }

  Microseconds last_ = 0;
  std::uint64_t shift_ = 0;
  std::uint64_t removed_ = 0;  ///< removed after the first event
  bool begun_ = false;
};

class DatEncoder final : public Encoder {
 public:
  explicit DatEncoder(SensorSize size)
      : Encoder("% Data file containing CD events.\n% Version 2\n% Height " +
                std::to_string(size.height) + "\n% Width " + std::to_string(size.width) +
                "\n% end\n" + static_cast<char>(event_cd) + static_cast<char>(record_size)) {}

  std::uint64_t removed_time() const override { return clock_.removed_time(); }

 private:
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    auto clock = clock_;
    const auto write = [&](std::span<const AbsoluteEvent> few, WordWriter<std::uint64_t>& words) {
      for (const auto& event : few) {
        const auto place = (std::uint32_t{event.x} & 0x3fff) |
                           (static_cast<std::uint32_t>(event.y_p) & 0x3fff) << 14 |
                           static_cast<std::uint32_t>(event.y_p >> 15) << 28;
        words.put(std::uint64_t{place} << 32 | clock.written(event.t));
      }
    };
    write_events<std::uint64_t>(events, events_at_once, out, write);
    clock_ = clock;
  }

  DatClock clock_;
};

}  // namespace

std::unique_ptr<EventDecoder> make_dat_decoder() {
  return std::make_unique<DatDecoder>();
}

std::unique_ptr<Encoder> make_dat_encoder(SensorSize size) {
  if (!is_side(size.width) || !is_side(size.height))
    throw std::invalid_argument("DAT files support sensors of 1x1 to 16384x16384 pixels");
  return std::make_unique<DatEncoder>(size);
}

}  // namespace eventcamera
