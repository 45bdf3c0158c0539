// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "src/core/byte_order.hpp"
#include "src/core/event.hpp"

namespace eventcamera {

/// Format of the events of an RTP packet (docs/rtp-payload-format.md).
enum class RtpEventFormat : std::uint8_t { evt3 = 0, xytp = 1 };

/// Maximum number of events in an interval; senders split longer ones.
inline constexpr std::size_t max_rtp_interval_events = std::size_t{1} << 20;

/// Maximum start of an interval; its end cannot overflow.
inline constexpr Nanoseconds max_rtp_start = std::numeric_limits<Nanoseconds>::max() - max_interval;

/// First bytes of the payload of each RTP packet.
struct RtpPayloadHeader {
  static constexpr std::size_t size = 28;

  RtpEventFormat format = RtpEventFormat::evt3;
  std::uint16_t event_count = 0;  ///< events in this packet
  std::uint32_t first_event = 0;  ///< number of its first event, modulo 2^32
  Nanoseconds start = 0;          ///< of the interval, on the sender's clock
  Nanoseconds duration = 0;       ///< of the interval
  std::uint32_t base = 0;         ///< added to event times; microseconds after `start`

  /// Writes `size` bytes.
  void write(std::uint8_t* to) const {
    to[0] = static_cast<std::uint8_t>(version << 4 | static_cast<unsigned>(format));
    to[1] = 0;
    store(event_count, to + 2, big);
    store(first_event, to + 4, big);
    store(static_cast<std::uint64_t>(start), to + 8, big);
    store(static_cast<std::uint64_t>(duration), to + 16, big);
    store(base, to + 24, big);
  }

  /// None unless `payload` starts with a valid header, and its size fits the number of events.
  static std::optional<RtpPayloadHeader> read(std::span<const std::uint8_t> payload) {
    if (payload.size() < size) return std::nullopt;
    const auto* bytes = payload.data();
    if (bytes[0] >> 4 != version || (bytes[0] & 15) > 1 || bytes[1] != 0) return std::nullopt;
    const RtpPayloadHeader header{
        .format = static_cast<RtpEventFormat>(bytes[0] & 15),
        .event_count = load<std::uint16_t>(bytes + 2, big),
        .first_event = load<std::uint32_t>(bytes + 4, big),
        .start = static_cast<Nanoseconds>(load<std::uint64_t>(bytes + 8, big)),
        .duration = static_cast<Nanoseconds>(load<std::uint64_t>(bytes + 16, big)),
        .base = load<std::uint32_t>(bytes + 24, big)};
    if (header.start < 0 || header.start > max_rtp_start || header.duration < 0 ||
        header.duration > max_interval ||
        !fits(header.format, payload.size() - size, header.event_count))
      return std::nullopt;
    return header;
  }

  friend bool operator==(const RtpPayloadHeader&, const RtpPayloadHeader&) = default;

 private:
  static constexpr unsigned version = 1;
  static constexpr auto big = std::endian::big;

  /// True if this many bytes can hold `count` events.
  static bool fits(RtpEventFormat format, std::size_t bytes, std::size_t count) {
    if (format == RtpEventFormat::xytp) return bytes == count * sizeof(Event);
    return bytes % 2 == 0 && (count == 0 ? bytes == 0 : bytes >= 2 && count <= bytes / 2 * 12);
  }
};

}  // namespace eventcamera
