// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <span>

namespace eventcamera {

inline constexpr std::uint64_t no_arrival = std::numeric_limits<std::uint64_t>::max();

/// The parts of an RTP packet that a receiver of events needs.
struct RtpPacket {
  std::uint32_t ssrc;
  std::uint16_t sequence_number;
  bool marker;  ///< last packet of its interval
  std::span<const std::uint8_t> payload;
  std::uint64_t arrival = 0;  ///< nanoseconds, on any clock; `no_arrival` if unknown
};

}  // namespace eventcamera
