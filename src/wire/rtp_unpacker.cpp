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

}  // namespace

RtpUnpacker::RtpUnpacker(SensorSize sensor, RtpEventFormat format)
    : sensor_(sensor), format_(format), decoder_(make_evt3_unit_decoder(sensor)) {}

void RtpUnpacker::change(SensorSize sensor, RtpEventFormat format) {
  decoder_ = make_evt3_unit_decoder(sensor);
  sensor_ = sensor;
  format_ = format;
}

void RtpUnpacker::reset() {
  position_.reset();
  previous_.reset();
  second_senders_.clear();
  close_interval();
  is_discontinuous_ = true;
}

void RtpUnpacker::close_interval() {
  if (interval_) end_ = interval_->start + interval_->duration;
  interval_.reset();
  events_.clear();
  is_discontinuous_ = false;
}

bool RtpUnpacker::decode(const RtpPacket& packet) {
  const auto header = RtpPayloadHeader::read(packet.payload);
  bool is_valid = header && header->format == format_;
  if (is_valid) {
    header_ = *header;
    is_valid = decode_events(packet.payload.subspan(RtpPayloadHeader::size));
  }
  // A late packet precedes the events of its interval.
  if (is_valid && is_of_interval(packet) && position_->packets_before(packet) >= 0)
    is_valid = continues_interval();
  if (is_valid && is_of_second_sender(packet)) {
    ++statistics_.second_sender_packets;
    is_valid = false;
  }
  if (!is_valid) count_rejected();
  return is_valid;
}

bool RtpUnpacker::continues_interval() const {
  return decoded_.empty() || events_.empty() ||
         (decoded_.front().t >= events_.back().t &&
          events_.size() + decoded_.size() <= max_rtp_interval_events);
}

bool RtpUnpacker::is_of_second_sender(const RtpPacket& packet) const {
  if (!position_ || std::ranges::find(second_senders_, packet.ssrc) == second_senders_.end())
    return false;
  return packet.arrival != no_arrival && heard_ != no_arrival &&
         packet.arrival < heard_ + max_silence;
}

void RtpUnpacker::change_sender(const RtpPacket& packet) {
  const bool returns =
      previous_ && previous_->ssrc == packet.ssrc && previous_->packets_before(packet) >= 0;
  std::erase(second_senders_, packet.ssrc);
  if (returns) {
    if (second_senders_.size() == max_second_senders)
      second_senders_.erase(second_senders_.begin());
    second_senders_.push_back(position_->ssrc);
  }
  previous_ = position_;
  is_discontinuous_ = true;
}

bool RtpUnpacker::is_late(const RtpPacket& packet) {
  const auto number = packet.sequence_number;
  if (!position_ || packet.ssrc != position_->ssrc || position_->packets_before(packet) >= 0)
    return false;
  late_in_a_row_ = number == next_late_ ? late_in_a_row_ + 1 : 1;
  next_late_ = static_cast<std::uint16_t>(number + 1);
  if (late_in_a_row_ < max_late_in_a_row) return true;
  position_.reset();
  return false;
}

bool RtpUnpacker::is_of_interval(const RtpPacket& packet) const {
  return interval_ && position_ && position_->ssrc == packet.ssrc &&
         header_.start == interval_->start && header_.duration == interval_->duration;
}

void RtpUnpacker::add(const RtpPacket& packet) {
  follow(packet);
  if (!interval_) {
    is_discontinuous_ |= header_.start < end_;
    interval_ = header_;
    arrival_ = packet.arrival;
  }
  events_.insert(events_.end(), decoded_.begin(), decoded_.end());
  ++statistics_.packets;
  statistics_.bytes += packet.payload.size();
  statistics_.events += header_.event_count;
}

void RtpUnpacker::follow(const RtpPacket& packet) {
  late_in_a_row_ = 0;
  heard_ = packet.arrival;
  if (!position_) {
    is_discontinuous_ = true;
  } else if (position_->ssrc != packet.ssrc) {
    change_sender(packet);
  } else {
    const auto packets =
        static_cast<std::uint16_t>(packet.sequence_number - position_->next_sequence_number);
    const auto events = static_cast<std::int32_t>(header_.first_event - position_->next_event);
    statistics_.lost_packets += packets;
    // Negative if the sender has restarted.
    if (events > 0) statistics_.lost_events += static_cast<std::uint32_t>(events);
    is_discontinuous_ |= packets != 0 || events != 0;
  }
  position_ = {.ssrc = packet.ssrc,
               .next_sequence_number = static_cast<std::uint16_t>(packet.sequence_number + 1),
               .next_event = header_.first_event + header_.event_count};
}

bool RtpUnpacker::decode_events(std::span<const std::uint8_t> body) {
  decoded_.clear();
  return format_ == RtpEventFormat::evt3 ? decode_evt3(body) : decode_xytp(body);
}

bool RtpUnpacker::decode_evt3(std::span<const std::uint8_t> words) {
  decoder_->restore({});
  corruption_ = {};
  words_.events.clear();
  words_.triggers.clear();
  Batch batch(corruption_);
  batch.start = words.data();
  const auto* from = words.data();
  const auto* const to = from + words.size();
  while (from != to) {
    batch.open(words_, static_cast<std::size_t>(to - from));
    from = decoder_->read(from, to, batch);
    for (const auto& event : batch.close())
      if (!decode(static_cast<std::uint64_t>(event.t), event.x, event.y_p)) return false;
  }
  return corruption_.places == 0 && corruption_.outside == 0 &&
         decoded_.size() == header_.event_count;
}

bool RtpUnpacker::decode_xytp(std::span<const std::uint8_t> body) {
  for (std::size_t i = 0; i < body.size(); i += sizeof(Event)) {
    const auto event = little_endian<Event>(body.data() + i);
    if (event.x >= sensor_.width || event.y() >= sensor_.height ||
        !decode(event.t, event.x, event.y_p))
      return false;
  }
  return true;
}

/// Decodes an event at `t`, relative to the header's base.
bool RtpUnpacker::decode(std::uint64_t t, std::uint16_t x, std::uint16_t y_p) {
  t += header_.base;
  const auto latest = (header_.start + header_.duration) / 1000 - header_.start / 1000;
  if (t > static_cast<std::uint64_t>(latest) || (!decoded_.empty() && t < decoded_.back().t))
    return false;
  decoded_.push_back({static_cast<std::uint32_t>(t), x, y_p});
  return true;
}

}  // namespace eventcamera
