// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include "src/core/byte_order.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t packet_header_size = 28;
constexpr std::size_t event_size = 8;
constexpr std::int64_t max_packet = std::int64_t{64} << 20;
/// Limits times to 2^60 microseconds.
constexpr std::int32_t max_overflow = 1 << 29;
/// Of a sensor of unknown size; more than any camera of this format had, so that corruption shows.
constexpr int widest = 8192;
/// Number of valid events that must follow an invalid one for it to be skipped alone.
constexpr std::uint64_t events_after = 4;

enum Type : int { special = 0, polarity = 1, last_type = 31 };

/// Bits of an event.
constexpr std::uint32_t valid = 1;
constexpr std::uint32_t on = 2;

int x_of(std::uint32_t data) {
  return static_cast<int>(data >> 17);
}
int y_of(std::uint32_t data) {
  return static_cast<int>(data >> 2 & 0x7fff);
}

struct PacketHeader {
  int type;
  int source;
  std::int32_t event_size;
  std::int32_t time_offset;
  std::int32_t overflow;
  std::int32_t capacity;
  std::int32_t number;
  std::int32_t valid_number;

  explicit PacketHeader(const std::uint8_t* bytes)
      : type(little_endian<std::int16_t>(bytes)),
        source(little_endian<std::int16_t>(bytes + 2)),
        event_size(little_endian<std::int32_t>(bytes + 4)),
        time_offset(little_endian<std::int32_t>(bytes + 8)),
        overflow(little_endian<std::int32_t>(bytes + 12)),
        capacity(little_endian<std::int32_t>(bytes + 16)),
        number(little_endian<std::int32_t>(bytes + 20)),
        valid_number(little_endian<std::int32_t>(bytes + 24)) {}

  bool of_events() const { return type == special || type == polarity; }
};

SensorSize size_of(std::string_view source) {
  struct Camera {
    std::string_view name;
    SensorSize size;
  };
  constexpr Camera cameras[] = {
      {"DVS128", {128, 128}},      {"DAVIS128", {128, 128}}, {"DAVIS208", {208, 192}},
      {"DAVIS240", {240, 180}},    {"DAVIS346", {346, 260}}, {"DAVIS640", {640, 480}},
      {"DAVISHet640", {640, 480}}, {"DAVISRGB", {640, 480}}, {"DVS132S", {132, 104}}};
  for (const auto& camera : cameras)
    if (source.find(camera.name) != std::string_view::npos) return camera.size;
  return {};
}

class Aedat3Decoder final : public EventDecoder {
 public:
  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override {
    queue_.push(bytes);
    if (header_read_ || read_header()) read_packets(out);
    queue_.keep();
  }

  void finish(Decoded& out) override {
    finished_ = true;
    if (!header_read_ && !read_header())
      throw header_.in_first_line() ? header_.wrong_magic()
                                    : UnsupportedFormat("truncated AEDAT 3.1 header");
    read_packets(out);
    const bool within = packet_.events != 0 || packet_.rest != 0;
    if (!scanning_ && (within || queue_.size() > 0))
      corruption_.note(queue_.position(), "truncated AEDAT 3.1 packet");
  }

 private:
  /// Rest of the packet being read.
  struct Packet {
    int type = 0;
    std::uint64_t events = 0;  ///< number of 8-byte events to read
    std::uint64_t rest = 0;    ///< number of bytes to skip after them
    Microseconds overflow = 0;
    bool is_intact = false;  ///< another packet, or the end of the file, is known to follow it
  };

  bool read_header() {
    auto next = header_.next(queue_);
    for (; next == AedatHeader::Next::line; next = header_.next(queue_))
      handle_line(header_.line());
    if (next == AedatHeader::Next::data)
      throw UnsupportedFormat("the AEDAT 3.1 header does not end with #!END-HEADER");
    header_read_ = next == AedatHeader::Next::last;
    return header_read_;
  }

  void handle_line(const std::string& line) {
    if (line.starts_with("#Format:") && line.find("RAW") == std::string::npos)
      throw UnsupportedFormat("unsupported compression of AEDAT 3.1: " + line.substr(1));
    // The camera and the filters of its events are separate sources, all of the same size.
    if ((line.starts_with("#Source") || line.starts_with("#-Source")) &&
        stream_.size == SensorSize{})
      stream_.size = size_of(line);
  }

  void read_packets(Decoded& out) {
    while (true) {
      if (packet_.events != 0) {
        if (!read_events(out)) return;
      } else if (packet_.rest != 0) {
        const auto bytes = queue_.peek(1);
        if (bytes.empty()) return;
        const auto count = std::min<std::uint64_t>(packet_.rest, bytes.size());
        packet_.rest -= count;
        queue_.consume(static_cast<std::size_t>(count));
      } else if ((scanning_ && !scan()) || !read_packet_header()) {
        return;
      }
    }
  }

  bool read_packet_header() {
    const auto bytes = queue_.peek(packet_header_size);
    if (bytes.empty()) return false;
    if (!begins_packet(bytes.data())) {
      corruption_.note(queue_.position(), "no AEDAT 3.1 packet here");
      scanning_ = true;
      return true;
    }
    const PacketHeader header(bytes.data());
    const auto events = header.of_events() ? header.number : 0;
    packet_ = {header.type, static_cast<std::uint64_t>(events),
               static_cast<std::uint64_t>(std::int64_t{header.capacity} - events) *
                   static_cast<std::uint64_t>(header.event_size),
               Microseconds{header.overflow} << 31};
    queue_.consume(packet_header_size);
    return true;
  }

  /// Reads the available events of the packet. False if more bytes are needed.
  bool read_events(Decoded& out) {
    const auto bytes = queue_.peek(event_size);
    const auto count = std::min<std::uint64_t>(bytes.size() / event_size, packet_.events);
    if (count == 0) return false;
    std::size_t i = 0;
    bool odd = false;
    for (; i < count; ++i) {
      const auto* const event = bytes.data() + i * event_size;
      odd = is_odd(event);
      if (odd) break;
      append(event, out);
    }
    packet_.events -= i;
    queue_.consume(i * event_size);
    return !odd || read_odd_event();
  }

  /// Handles an invalid event: either it is corrupt, or this packet is short and the next one
  /// starts here, or bytes are missing and the data is misaligned. Events outside the sensor may
  /// follow each other; then, the next packet starts where this one ends. False if more bytes are
  /// needed.
  bool read_odd_event() {
    const auto after = std::min<std::uint64_t>(packet_.events - 1, events_after);
    const auto wanted = std::max(packet_header_size, (1 + after) * event_size);
    if (queue_.size() < wanted && !finished_) return false;
    const auto next = queue_.peek(std::min(queue_.size(), wanted));
    bool sound_after = true;
    for (std::size_t k = 1; k <= after && (k + 1) * event_size <= next.size(); ++k)
      sound_after &= !is_odd(next.data() + k * event_size);
    if (next.size() >= packet_header_size && begins_packet(next.data())) {
      corruption_.note(queue_.position(), "AEDAT 3.1 packet shorter than its header says");
      packet_ = {};
      return true;
    }
    if (!sound_after && !packet_.is_intact) {
      const auto is_intact = is_packet_intact();
      if (!is_intact) return false;
      packet_.is_intact = *is_intact;
    }
    if (!sound_after && !packet_.is_intact) {
      corruption_.note(queue_.position(), "no AEDAT 3.1 events here");
      packet_ = {};
      scanning_ = true;
    } else {
      if (little_endian<std::int32_t>(queue_.peek(event_size).data() + 4) < 0)
        corruption_.note(queue_.position(), "event with a negative timestamp");
      else
        ++corruption_.outside;
      --packet_.events;
      queue_.consume(event_size);
    }
    return true;
  }

  /// True if another packet, or the end of the file, follows where the packet ends. Nothing if more
  /// bytes are needed.
  std::optional<bool> is_packet_intact() {
    const auto size = static_cast<std::size_t>(packet_.events * event_size + packet_.rest);
    const auto next = queue_.peek(size + packet_header_size);
    if (!next.empty()) return begins_packet(next.data() + size);
    if (!finished_) return std::nullopt;
    return queue_.size() == size;
  }

  /// Skips to the next likely packet of events. False if more bytes are needed.
  bool scan() {
    while (true) {
      const auto bytes = queue_.peek(packet_header_size);
      if (bytes.empty()) return false;
      if (begins_packet(bytes.data())) {
        const PacketHeader header(bytes.data());
        if (header.of_events() && header.number > 0 && header.capacity == header.number) break;
      }
      queue_.consume(1);
    }
    scanning_ = false;
    return true;
  }

  bool begins_packet(const std::uint8_t* bytes) const {
    const PacketHeader header(bytes);
    if (header.type < 0 || header.type > last_type || header.source < 0) return false;
    if (header.event_size < static_cast<std::int32_t>(event_size) ||
        (header.of_events() && header.event_size != static_cast<std::int32_t>(event_size)))
      return false;
    if (header.time_offset < 0 || header.time_offset > header.event_size - 4) return false;
    if (header.of_events() && header.time_offset != 4) return false;
    if (header.overflow < 0 || header.overflow >= max_overflow) return false;
    if (header.valid_number < 0 || header.number < header.valid_number ||
        header.capacity < header.number)
      return false;
    return std::int64_t{header.capacity} * header.event_size <= max_packet;
  }

  /// True if an event is outside the sensor or has an invalid time. With an unknown sensor size, a
  /// packet header read as an event counts as odd, too, because its row is beyond any sensor.
  bool is_odd(const std::uint8_t* event) const {
    const auto data = little_endian<std::uint32_t>(event);
    if (little_endian<std::int32_t>(event + 4) < 0) return true;
    if (packet_.type != polarity || (data & valid) == 0) return false;
    const auto limit = stream_.size != SensorSize{} ? stream_.size : SensorSize{widest, widest};
    return x_of(data) >= limit.width || y_of(data) >= limit.height;
  }

  void append(const std::uint8_t* event, Decoded& out) {
    const auto data = little_endian<std::uint32_t>(event);
    if ((data & valid) == 0) return;
    const auto t = packet_.overflow | little_endian<std::int32_t>(event + 4);
    if (packet_.type == polarity) {
      out.events.push_back(AbsoluteEvent::at(x_of(data), y_of(data), t,
                                             (data & on) != 0 ? Polarity::on : Polarity::off));
      return;
    }
    struct Input {
      std::uint32_t rising;  ///< type of the rising edge; falling edge and pulse follow
      std::uint16_t id;
    };
    constexpr Input inputs[] = {{2, 0}, {6, 1}, {9, 2}};
    const auto type = data >> 1 & 0x7f;
    for (const auto& input : inputs)
      if (type >= input.rising && type <= input.rising + 2)
        out.triggers.push_back({t, input.id, type != input.rising + 1});
  }

  ByteQueue queue_;
  bool finished_ = false;
  AedatHeader header_{"#!AER-DAT3.1", "#!END-HEADER"};
  bool header_read_ = false;
  bool scanning_ = false;  ///< searching for the next packet
  Packet packet_;
};

}  // namespace

std::unique_ptr<EventDecoder> make_aedat3_decoder() {
  return std::make_unique<Aedat3Decoder>();
}

}  // namespace eventcamera
