// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cctype>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "src/core/address_layout.hpp"
#include "src/core/byte_order.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"

namespace eventcamera {

namespace {

/// A camera that a header names.
struct Aedat2Camera {
  std::string_view name;  ///< part of it, in lower case
  SensorSize size;
  AddressLayout layout;
};
constexpr Aedat2Camera aedat2_cameras[] = {
    {"dvs128", {128, 128}, dvs128_layout},     {"dvs640", {640, 480}, dvs640_layout},
    {"davis128", {128, 128}, davis_layout},    {"davis208", {208, 192}, davis_layout},
    {"davis240", {240, 180}, davis_layout},    {"sbret", {240, 180}, davis_layout},
    {"davis346", {346, 260}, davis_layout},    {"davis640", {640, 480}, davis_layout},
    {"davisrgbw640", {640, 480}, davis_layout}};

/// Layout of addresses, inferred from their magnitude. v2e has no DVS128.
AddressLayout aedat2_layout_of(std::span<const std::uint32_t> addresses, bool of_v2e) {
  const auto many_are_past = [&](std::uint32_t max_address) {
    const auto count = std::ranges::count_if(
        addresses, [&](std::uint32_t address) { return address > max_address; });
    return 16 * static_cast<std::size_t>(count) > addresses.size();
  };
  if (many_are_past(dvs640_layout.max_address)) return davis_layout;
  return of_v2e || many_are_past(dvs128_layout.max_address) ? dvs640_layout : dvs128_layout;
}

/// Number of records that determine the layout of addresses.
constexpr std::size_t layout_records = 1024;

/// Times have 32 bits. A larger step backwards than max_disorder is a wrap.
constexpr std::int64_t wrap = std::int64_t{1} << 32;
constexpr std::int64_t max_disorder = 1'000'000;
/// A larger step of time is checked against the next record before it is trusted.
constexpr std::int64_t large_step = 60'000'000;

/// Number of consecutive valid records after which scanning stops.
constexpr std::size_t sound_records = 8;
/// Number of valid records that must follow an odd one for it to be skipped alone.
constexpr std::size_t records_after = 4;

std::string lowercase(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

/// A size such as 640x480 in a line of a header.
std::optional<SensorSize> size_in(std::string_view line) {
  const auto side = [](std::string_view digits) {
    int number = 0;
    for (const char c : digits) number = std::min(10 * number + (c - '0'), 1 << 20);
    return number;
  };
  constexpr std::string_view decimal = "0123456789";
  constexpr int min_side = 16;
  constexpr int max_width = 1024;
  constexpr int max_height = 512;
  for (auto x = line.find('x'); x != std::string_view::npos; x = line.find('x', x + 1)) {
    const auto from = line.substr(0, x).find_last_not_of(decimal) + 1;
    const auto to = std::min(line.find_first_not_of(decimal, x + 1), line.size());
    const SensorSize size{side(line.substr(from, x - from)), side(line.substr(x + 1, to - x - 1))};
    if (size.width >= min_side && size.width <= max_width && size.height >= min_side &&
        size.height <= max_height)
      return size;
  }
  return std::nullopt;
}

class Aedat2Decoder final : public EventDecoder {
 public:
  Aedat2Decoder(SensorSize assumed, Aedat2Version version)
      : assumed_(assumed),
        address_size_(version == Aedat2Version::one ? 2 : 4),
        record_size_(address_size_ + 4),
        header_(version == Aedat2Version::one ? "#!AER-DAT1.0" : "#!AER-DAT2.0",
                "#End Of ASCII Header") {
    if (version == Aedat2Version::one) layout_ = dvs128_layout;
  }

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override {
    queue_.push(bytes);
    if (header_read_ || read_header()) read_records(out);
    queue_.keep();
  }

  void finish(Decoded& out) override {
    finished_ = true;
    if (!header_read_ && !read_header()) {
      if (header_.in_first_line()) throw header_.wrong_magic();
      if (header_.in_line()) corruption_.note(queue_.position(), "truncated AEDAT header");
      header_read_ = true;
    }
    read_records(out);
    if (queue_.size() > 0 && !scanning_)
      corruption_.note(queue_.position(), "truncated AEDAT record");
  }

 private:
  struct Record {
    std::uint32_t address;
    std::int32_t t;
  };

  bool read_header() {
    auto next = header_.next(queue_);
    for (; next == AedatHeader::Next::line; next = header_.next(queue_))
      handle_line(header_.line());
    header_read_ = next != AedatHeader::Next::more;
    return header_read_;
  }

  void handle_line(const std::string& line) {
    constexpr std::string_view chip = "# AEChip:";
    if (line.starts_with(chip)) {
      const auto name = lowercase(std::string_view(line).substr(chip.size()));
      const auto* const camera = std::ranges::find_if(
          aedat2_cameras,
          [&](const Aedat2Camera& known) { return name.find(known.name) != name.npos; });
      if (camera != std::end(aedat2_cameras)) {
        stream_.size = camera->size;
        layout_ = camera->layout;
      } else if (assumed_ == SensorSize{}) {
        throw UnsupportedFormat("unsupported camera in the AEDAT 2.0 header: " + name +
                                "; set width and height");
      }
    } else if (stream_.size == SensorSize{}) {
      stream_.size = size_in(line).value_or(SensorSize{});
    }
    if (line.find("v2e") != std::string::npos) of_v2e_ = true;
  }

  /// Determines the layout from the first addresses. False if more bytes are needed.
  bool find_layout() {
    const auto wanted = record_size_ * layout_records;
    if (queue_.size() < wanted && !finished_) return false;
    const auto bytes = queue_.peek(std::min(queue_.size(), wanted));
    std::vector<std::uint32_t> addresses;
    for (std::size_t i = 0; i + record_size_ <= std::min(bytes.size(), wanted); i += record_size_)
      addresses.push_back(record_at(bytes.data() + i).address);
    layout_ = aedat2_layout_of(addresses, of_v2e_);
    return true;
  }

  /// Uses the stated size, or the size of all cameras with this layout.
  void find_size() {
    constexpr SensorSize max_davis_size{640, 480};
    if (stream_.size == SensorSize{}) stream_.size = assumed_;
    if (stream_.size == SensorSize{} && layout_ == dvs128_layout) stream_.size = {128, 128};
    if (stream_.size == SensorSize{} && layout_ == dvs640_layout) stream_.size = {640, 480};
    stream_.mirrored = stream_.size == SensorSize{};
    limit_ = stream_.mirrored ? max_davis_size : stream_.size;
  }

  void read_records(Decoded& out) {
    if (limit_ == SensorSize{}) {
      if (!layout_ && !find_layout()) return;
      find_size();
    }
    while (!scanning_ || scan()) {
      const auto bytes = queue_.peek(record_size_);
      const auto count = bytes.size() / record_size_;
      std::size_t i = 0;
      for (; i < count; ++i) {
        const auto record = record_at(bytes.data() + i * record_size_);
        if (!within_sensor(record.address) || far(record.t)) break;
        append(record, out);
      }
      queue_.consume(i * record_size_);
      if (count == 0 || (i < count && !read_odd_record(out))) return;
    }
  }

  /// Handles a record with an odd address or time. False if more bytes are needed.
  bool read_odd_record(Decoded& out) {
    const auto wanted = record_size_ * (1 + records_after);
    if (queue_.size() < wanted && !finished_) return false;
    const auto bytes = queue_.peek(std::min(queue_.size(), wanted));
    const auto after = std::min(wanted, bytes.size()) / record_size_ - 1;
    const auto record = record_at(bytes.data());
    bool sound_after = true;
    for (std::size_t i = 1; i <= after; ++i)
      sound_after &= within_sensor(record_at(bytes.data() + i * record_size_).address);
    const bool within = within_sensor(record.address);
    if (!sound_after) {
      corruption_.note(queue_.position(), "no AEDAT records here");
      queue_.consume(1);
      scanning_ = true;
      return true;
    }
    if (!within)
      ++corruption_.outside;
    else if (after > 0 && !far(record_at(bytes.data() + record_size_).t))
      corruption_.note(queue_.position(), "timestamp far from those around it");
    else
      append(record, out);
    queue_.consume(record_size_);
    return true;
  }

  /// Skips to the next valid records. False if more bytes are needed.
  bool scan() {
    const auto wanted = record_size_ * sound_records;
    while (true) {
      const auto bytes = queue_.peek(wanted);
      if (bytes.empty()) return false;
      std::optional<std::int32_t> before;
      bool sound = true;
      for (std::size_t i = 0; i < sound_records && sound; ++i) {
        const auto record = record_at(bytes.data() + i * record_size_);
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

  bool within_sensor(std::uint32_t address) const {
    if (address > layout_->max_address) return false;
    return layout_->is_sample(address) || layout_->is_external(address) ||
           (layout_->x(address) < limit_.width && layout_->y(address) < limit_.height);
  }

  /// True if `t` is a large step from the last time, possibly over a wrap.
  bool far(std::int32_t t) const {
    if (!last_) return false;
    return unwrapped(t) - (wraps_ + *last_) > large_step;
  }

  /// Returns the time with wraps undone.
  Microseconds unwrapped(std::int32_t t) const {
    if (!last_) return t;
    const auto step = std::int64_t{t} - *last_;
    if (step < -max_disorder) return wraps_ + wrap + t;
    if (step > wrap - max_disorder) return wraps_ - wrap + t;  // late event from before the wrap
    return wraps_ + t;
  }

  void append(const Record& record, Decoded& out) {
    const auto t = unwrapped(record.t);
    if (!last_ || t > wraps_ + *last_) {
      wraps_ = t - record.t;
      last_ = record.t;
    }
    const auto address = record.address;
    if (layout_->is_sample(address)) return;
    if (layout_->is_external(address)) {
      out.triggers.push_back({t, 0, layout_->is_rising(address)});
      return;
    }
    const auto x = layout_->x(address);
    const auto y = layout_->y(address);
    const auto polarity = layout_->is_on(address) ? Polarity::on : Polarity::off;
    out.events.push_back(stream_.mirrored ? AbsoluteEvent::at(x, y, t, polarity)
                                          : AbsoluteEvent::at(limit_.width - 1 - x,
                                                              limit_.height - 1 - y, t, polarity));
  }

  Record record_at(const std::uint8_t* bytes) const {
    constexpr auto big = std::endian::big;
    return {address_size_ == 2 ? load<std::uint16_t>(bytes, big) : load<std::uint32_t>(bytes, big),
            static_cast<std::int32_t>(load<std::uint32_t>(bytes + address_size_, big))};
  }

  const SensorSize assumed_;
  const std::size_t address_size_;  ///< in bytes
  const std::size_t record_size_;
  ByteQueue queue_;
  bool finished_ = false;

  AedatHeader header_;
  bool of_v2e_ = false;
  bool header_read_ = false;
  std::optional<AddressLayout> layout_;
  SensorSize limit_;  ///< of rows and columns

  bool scanning_ = false;             ///< searching for the next valid records
  std::int64_t wraps_ = 0;            ///< sum of the wraps so far
  std::optional<std::int32_t> last_;  ///< time of the latest record, as stored
};

}  // namespace

std::unique_ptr<EventDecoder> make_aedat2_decoder(SensorSize assumed, Aedat2Version version) {
  return std::make_unique<Aedat2Decoder>(assumed, version);
}

}  // namespace eventcamera
