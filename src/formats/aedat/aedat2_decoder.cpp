// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat2_decoder.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace eventcamera {

namespace {

constexpr std::size_t record_size = 8;

// Address bits of DAVIS cameras.
constexpr std::uint32_t davis_sample = 0x80000000;  // frame or IMU sample
constexpr std::uint32_t davis_external = 1U << 10;
constexpr std::uint32_t davis_on = 1U << 11;
constexpr std::uint32_t davis_falling = 2;
constexpr std::uint32_t edge_mask = 7;
// Address bits of the DVS128.
constexpr std::uint32_t dvs128_external = 0x8000;
constexpr std::uint32_t dvs128_largest = 0xffff;
constexpr std::uint32_t dvs128_off = 1;

/// Times have 32 bits. A larger step backwards than max_disorder is a wrap.
constexpr std::int64_t wrap = std::int64_t{1} << 32;
constexpr std::int64_t max_disorder = 1'000'000;
/// A larger step of time is checked against the next record before it is trusted.
constexpr std::int64_t large_step = 60'000'000;

/// Number of consecutive valid records after which scanning stops.
constexpr std::size_t sound_records = 8;
/// Number of valid records that must follow an odd one for it to be skipped alone.
constexpr std::size_t records_behind = 4;

std::string lowercase(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::uint32_t big_endian(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

/// Sensor size of a chip named in the header.
SensorSize size_of(const std::string& chip) {
  struct Chip {
    std::string_view name;
    SensorSize size;
  };
  constexpr Chip chips[] = {{"dvs128", {128, 128}},   {"davis128", {128, 128}},
                            {"davis208", {208, 192}}, {"davis240", {240, 180}},
                            {"sbret", {240, 180}},    {"davis346", {346, 260}},
                            {"davis640", {640, 480}}, {"davisrgbw640", {640, 480}}};
  for (const auto& known : chips)
    if (chip.find(known.name) != std::string::npos) return known.size;
  throw UnsupportedFormat("unsupported camera in the AEDAT 2.0 header: " + chip);
}

}  // namespace

void Aedat2Decoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  queue_.push(bytes);
  if (header_read_ || read_header()) read_records(out);
  queue_.keep();
}

void Aedat2Decoder::finish(Decoded& out) {
  finished_ = true;
  if (!header_read_ && !read_header()) {
    if (header_.in_first_line()) throw header_.wrong_magic();
    if (header_.in_line()) corruption_.note(queue_.position(), "truncated AEDAT 2.0 header");
    end_header();
  }
  read_records(out);
  if (queue_.size() > 0 && !scanning_)
    corruption_.note(queue_.position(), "truncated AEDAT 2.0 record");
}

bool Aedat2Decoder::read_header() {
  auto next = header_.next(queue_);
  for (; next == AedatHeader::Next::line; next = header_.next(queue_)) take_line(header_.line());
  if (next == AedatHeader::Next::more) return false;
  end_header();
  return true;
}

/// Evaluates a line of the header.
void Aedat2Decoder::take_line(const std::string& line) {
  constexpr std::string_view chip = "# AEChip:";
  if (line.starts_with(chip)) {
    const auto name = lowercase(std::string_view(line).substr(chip.size()));
    size_ = size_of(name);
    davis_ = name.find("dvs128") == std::string::npos;
  }
  if (line.find("v2e") != std::string::npos) of_v2e_ = true;
}

void Aedat2Decoder::end_header() {
  header_read_ = true;
  data_at_ = queue_.position();
  if (size_ != SensorSize{}) return;
  constexpr SensorSize dvs128{128, 128};
  constexpr SensorSize davis346{346, 260};
  size_ = assumed_ != SensorSize{} ? assumed_ : of_v2e_ ? davis346 : dvs128;
  davis_ = size_ != dvs128;
}

void Aedat2Decoder::read_records(Decoded& out) {
  while (!scanning_ || scan()) {
    const auto bytes = queue_.peek(record_size);
    const auto count = bytes.size() / record_size;
    std::size_t i = 0;
    for (; i < count; ++i) {
      const auto record = record_at(bytes.data() + i * record_size);
      if (!within_sensor(record.address) || far(record.t)) break;
      append(record, out);
    }
    queue_.consume(i * record_size);
    if (count == 0 || (i < count && !read_odd_record(out))) return;
  }
}

/// Handles a record with an odd address or time. False if more bytes are needed.
bool Aedat2Decoder::read_odd_record(Decoded& out) {
  const auto wanted = record_size * (1 + records_behind);
  if (queue_.size() < wanted && !finished_) return false;
  const auto bytes = queue_.peek(std::min(queue_.size(), wanted));
  const auto behind = std::min(wanted, bytes.size()) / record_size - 1;
  const auto record = record_at(bytes.data());
  bool sound_behind = true;
  for (std::size_t i = 1; i <= behind; ++i)
    sound_behind &= within_sensor(record_at(bytes.data() + i * record_size).address);
  const bool within = within_sensor(record.address);
  if (!sound_behind) {
    corruption_.note(queue_.position(), "no AEDAT 2.0 records here");
    queue_.consume(1);
    scanning_ = true;
    return true;
  }
  if (!within)
    ++corruption_.outside;
  else if (behind > 0 && !far(record_at(bytes.data() + record_size).t))
    corruption_.note(queue_.position(), "timestamp far from those around it");
  else
    append(record, out);
  queue_.consume(record_size);
  return true;
}

/// Skips to the next valid records. False if more bytes are needed.
bool Aedat2Decoder::scan() {
  constexpr auto wanted = record_size * sound_records;
  while (true) {
    const auto bytes = queue_.peek(wanted);
    if (bytes.empty()) return false;
    std::optional<std::int32_t> before;
    bool sound = true;
    for (std::size_t i = 0; i < sound_records && sound; ++i) {
      const auto record = record_at(bytes.data() + i * record_size);
      const auto step = std::int64_t{record.t} - before.value_or(record.t);
      sound = within_sensor(record.address) && step >= 0 && step < large_step;
      before = record.t;
    }
    if (sound) break;
    queue_.consume(1);
  }
  scanning_ = false;
  return true;
}

bool Aedat2Decoder::within_sensor(std::uint32_t address) const {
  if (!davis_) return address <= dvs128_largest;
  if ((address & davis_sample) != 0) return true;
  return static_cast<int>(address >> 22 & 0x1ff) < size_.height &&
         static_cast<int>(address >> 12 & 0x3ff) < size_.width;
}

/// True if `t` is a large step from the last time, possibly over a wrap.
bool Aedat2Decoder::far(std::int32_t t) const {
  if (!last_) return false;
  const auto step = unwrapped(t) - (wraps_ + *last_);
  return step > large_step;
}

/// Returns the time with wraps undone.
Microseconds Aedat2Decoder::unwrapped(std::int32_t t) const {
  if (!last_) return t;
  const auto step = std::int64_t{t} - *last_;
  if (step < -max_disorder) return wraps_ + wrap + t;
  if (step > wrap - max_disorder) return wraps_ - wrap + t;  // late event from before the wrap
  return wraps_ + t;
}

void Aedat2Decoder::append(const Record& record, Decoded& out) {
  const auto t = unwrapped(record.t);
  if (!last_ || t > wraps_ + *last_) {
    wraps_ = t - record.t;
    last_ = record.t;
  }
  const auto address = record.address;
  if (davis_) {
    if ((address & davis_sample) != 0) return;
    // v2e marks noise events with the bit of external events, but keeps their pixel address.
    if ((address & ~(davis_external | edge_mask)) == 0 && (address & davis_external) != 0) {
      out.triggers.push_back({t, 0, (address & edge_mask) != davis_falling});
      return;
    }
  } else if ((address & dvs128_external) != 0) {
    out.triggers.push_back({t, 0, true});
    return;
  }
  // Rows are counted from the bottom and columns from the right.
  const auto x = static_cast<int>(davis_ ? address >> 12 & 0x3ff : address >> 1 & 0x7f);
  const auto y = static_cast<int>(davis_ ? address >> 22 & 0x1ff : address >> 8 & 0x7f);
  const bool on = davis_ ? (address & davis_on) != 0 : (address & dvs128_off) == 0;
  if (t < newest_) ++corruption_.unsorted;
  newest_ = std::max(newest_, t);
  out.events.push_back(AbsoluteEvent::at(size_.width - 1 - x, size_.height - 1 - y, t,
                                         on ? Polarity::on : Polarity::off));
}

Aedat2Decoder::Record Aedat2Decoder::record_at(const std::uint8_t* bytes) {
  return {big_endian(bytes), static_cast<std::int32_t>(big_endian(bytes + 4))};
}

}  // namespace eventcamera
