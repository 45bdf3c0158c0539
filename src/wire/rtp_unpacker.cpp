// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_unpacker.hpp"

#include <algorithm>

#include "src/core/byte_order.hpp"
#include "src/formats/evt/words.hpp"

namespace eventcamera {
namespace {

/// Number of consecutive late packets after which the sender is assumed to have restarted.
constexpr int max_late_in_a_row = 16;

/// Silence after which a sender is assumed to have ended, nanoseconds.
constexpr std::uint64_t max_silence = 1'000'000'000;

/// Number of second senders that are remembered.
constexpr std::size_t max_second_senders = 16;

class Appender {
 public:
  Appender(const RtpPayloadHeader& header, std::vector<Event>& events)
      : events_(events),
        base_(header.base),
        latest_(static_cast<std::uint64_t>((header.start + header.duration) / 1000 -
                                           header.start / 1000)) {}

  /// Appends an event at `t`, relative to the header's base. False if it is earlier than the one
  /// before, or outside the interval.
  bool append(std::uint64_t t, std::uint16_t x, std::uint16_t y_p) {
    t += base_;
    if (t > latest_ || t < earliest_) return false;
    earliest_ = t;
    events_.push_back({static_cast<std::uint32_t>(t), x, y_p});
    return true;
  }

 private:
  std::vector<Event>& events_;
  std::uint64_t base_;
  std::uint64_t latest_;
  std::uint64_t earliest_ = 0;
};

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

RtpUnpacker::RtpUnpacker(SensorSize sensor, RtpEventFormat format) {
  change(sensor, format);
}

void RtpUnpacker::change(SensorSize sensor, RtpEventFormat format) {
  sensor_ = sensor;
  format_ = format;
  evt3_ = make_evt3_unit_decoder(sensor);
}

void RtpUnpacker::reset() {
  sender_ = {};
  close_interval();
  is_discontinuous_ = true;
}

void RtpUnpacker::close_interval() {
  if (interval_) end_ = interval_->start + interval_->duration;
  interval_.reset();
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(event_count_));
  event_count_ = 0;
  is_discontinuous_ = false;
}

std::optional<RtpPayloadHeader> RtpUnpacker::decode(const RtpPacket& packet) {
  events_.resize(event_count_);
  const auto header = RtpPayloadHeader::read(packet.payload);
  if (!header || header->format != format_) return std::nullopt;
  const auto body = packet.payload.subspan(RtpPayloadHeader::size);
  const bool is_valid =
      format_ == RtpEventFormat::evt3 ? decode_evt3(*header, body) : decode_xytp(*header, body);
  if (!is_valid || (is_of_interval(packet, *header) && !continues_interval())) return std::nullopt;
  if (sender_.is_of_second_sender(packet)) {
    ++statistics_.second_sender_packets;
    return std::nullopt;
  }
  return header;
}

bool RtpUnpacker::decode_evt3(const RtpPayloadHeader& header, std::span<const std::uint8_t> words) {
  evt3_->restore({});
  corruption_ = {};
  words_.triggers.clear();
  Appender appender(header, events_);
  Batch batch(corruption_);
  while (!words.empty()) {
    words_.events.clear();
    words = words.subspan(evt3_->decode(words, 0, batch, words_));
    for (const auto& event : words_.events)
      if (!appender.append(static_cast<std::uint64_t>(event.t), event.x, event.y_p)) return false;
  }
  return corruption_.places == 0 && corruption_.outside == 0 &&
         events_.size() - event_count_ == header.event_count;
}

bool RtpUnpacker::decode_xytp(const RtpPayloadHeader& header, std::span<const std::uint8_t> bytes) {
  Appender appender(header, events_);
  for (std::size_t i = 0; i < bytes.size(); i += sizeof(Event)) {
    const auto event = little_endian<Event>(bytes.data() + i);
    if (event.x >= sensor_.width || event.y() >= sensor_.height ||
        !appender.append(event.t, event.x, event.y_p))
      return false;
  }
  return true;
}

bool RtpUnpacker::is_of_interval(const RtpPacket& packet, const RtpPayloadHeader& header) const {
  return interval_ && sender_.is_next(packet) && header.start == interval_->start &&
         header.duration == interval_->duration;
}

bool RtpUnpacker::continues_interval() const {
  return event_count_ == 0 || events_.size() == event_count_ ||
         (events_[event_count_].t >= events_[event_count_ - 1].t &&
          events_.size() <= max_rtp_interval_events);
}

void RtpUnpacker::add(const RtpPacket& packet, const RtpPayloadHeader& header) {
  const auto loss = sender_.follow(packet, header);
  is_discontinuous_ |= loss.is_discontinuous;
  if (!interval_) {
    is_discontinuous_ |= header.start < end_;
    interval_ = header;
    arrival_ = packet.arrival;
  }
  event_count_ = events_.size();
  ++statistics_.packets;
  statistics_.bytes += packet.payload.size();
  statistics_.events += header.event_count;
  statistics_.lost_packets += loss.packets;
  statistics_.lost_events += loss.events;
}

}  // namespace eventcamera
