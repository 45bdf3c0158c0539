// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

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
  void write(std::uint8_t* to) const;

  /// None unless `payload` starts with a valid header, and its size fits the number of events.
  static std::optional<RtpPayloadHeader> read(std::span<const std::uint8_t> payload);

  friend bool operator==(const RtpPayloadHeader&, const RtpPayloadHeader&) = default;
};

}  // namespace eventcamera
