// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_sender_tracker.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

/// Number of consecutive late packets after which the sender is assumed to have restarted.
constexpr int max_late_in_a_row = 16;

/// Silence after which a sender is assumed to have ended, nanoseconds.
constexpr std::uint64_t max_silence = 1'000'000'000;

/// Number of second senders that are remembered.
constexpr std::size_t max_second_senders = 16;

}  // namespace

bool RtpSenderTracker::is_of_second_sender(const RtpPacket& packet) const {
  if (!position_ || std::ranges::find(second_senders_, packet.ssrc) == second_senders_.end())
    return false;
  return packet.arrival != no_arrival && heard_ != no_arrival &&
         packet.arrival < heard_ + max_silence;
}

bool RtpSenderTracker::is_late(const RtpPacket& packet) const {
  return is_current(packet) && !is_next(packet) && late_in_a_row(packet) < max_late_in_a_row;
}

void RtpSenderTracker::drop_late(const RtpPacket& packet) {
  late_in_a_row_ = late_in_a_row(packet);
  next_late_ = static_cast<std::uint16_t>(packet.sequence_number + 1);
}

RtpSenderTracker::Loss RtpSenderTracker::follow(const RtpPacket& packet,
                                                const RtpPayloadHeader& header) {
  Loss loss;
  if (is_next(packet)) {
    loss.packets =
        static_cast<std::uint16_t>(packet.sequence_number - position_->next_sequence_number);
    const auto events = static_cast<std::int32_t>(header.first_event - position_->next_event);
    // Negative if the sender has restarted.
    loss.events = static_cast<std::uint32_t>(std::max(events, 0));
    loss.is_discontinuous = loss.packets != 0 || events != 0;
  } else if (position_ && !is_current(packet)) {
    change_sender(packet);
  }
  late_in_a_row_ = 0;
  heard_ = packet.arrival;
  position_ = {.ssrc = packet.ssrc,
               .next_sequence_number = static_cast<std::uint16_t>(packet.sequence_number + 1),
               .next_event = header.first_event + header.event_count};
  return loss;
}

void RtpSenderTracker::change_sender(const RtpPacket& packet) {
  const bool returns =
      previous_ && previous_->ssrc == packet.ssrc && previous_->packets_before(packet) >= 0;
  std::erase(second_senders_, packet.ssrc);
  if (returns) {
    if (second_senders_.size() == max_second_senders)
      second_senders_.erase(second_senders_.begin());
    second_senders_.push_back(position_->ssrc);
  }
  previous_ = position_;
}

}  // namespace eventcamera
