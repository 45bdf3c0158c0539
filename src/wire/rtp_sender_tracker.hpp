// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "src/wire/rtp_payload.hpp"

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

/// Follows the packets of one sender.
///
/// A new SSRC is followed at once: the sender restarted. If the SSRC before it continues, there are
/// two senders, and the new one is rejected until the other has been silent for a second.
class RtpSenderTracker {
 public:
  /// Packets and events missing before a packet.
  struct Loss {
    std::uint32_t packets = 0;  ///< by sequence number
    std::uint32_t events = 0;   ///< by event number
    bool is_discontinuous = true;
  };

  /// Whether the current sender sent the packet.
  bool is_current(const RtpPacket& packet) const {
    return position_ && position_->ssrc == packet.ssrc;
  }
  /// Whether the current sender sent the packet after those that were followed.
  bool is_next(const RtpPacket& packet) const {
    return is_current(packet) && position_->packets_before(packet) >= 0;
  }
  /// Whether a second sender sent the packet, and the first one is not silent.
  bool is_of_second_sender(const RtpPacket& packet) const;

  /// Whether the current sender sent the packet before those that were followed. After many of
  /// them in a row, the sender must have restarted: they are no longer late.
  bool is_late(const RtpPacket& packet) const;

  /// Counts a late packet.
  void drop_late(const RtpPacket& packet);

  /// Makes the sender of the packet, which is not late, the current one.
  Loss follow(const RtpPacket& packet, const RtpPayloadHeader& header);

 private:
  /// Position in the stream of a sender.
  struct Position {
    std::uint32_t ssrc;
    std::uint16_t next_sequence_number;
    std::uint32_t next_event;

    /// Number of packets that are missing before this one; negative after the expected one.
    int packets_before(const RtpPacket& packet) const {
      return static_cast<std::int16_t>(packet.sequence_number - next_sequence_number);
    }
  };

  /// Number of consecutive late packets, with this one.
  int late_in_a_row(const RtpPacket& packet) const {
    return packet.sequence_number == next_late_ ? late_in_a_row_ + 1 : 1;
  }
  void change_sender(const RtpPacket& packet);

  std::optional<Position> position_;
  std::uint64_t heard_ = no_arrival;           ///< arrival of the last packet
  std::optional<Position> previous_;           ///< in the stream of the sender before
  std::vector<std::uint32_t> second_senders_;  ///< SSRCs, oldest first
  std::uint16_t next_late_ = 0;  ///< sequence number that continues the last late packet
  int late_in_a_row_ = 0;
};

}  // namespace eventcamera
