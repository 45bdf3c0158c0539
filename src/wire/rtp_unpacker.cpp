// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_unpacker.hpp"

#include "src/formats/evt/words.hpp"
#include "src/formats/little_endian.hpp"

namespace eventcamera {
namespace {

/// Consecutive late packets after which the sender is taken to have started over.
constexpr int max_late_in_a_row = 16;

}  // namespace

RtpUnpacker::RtpUnpacker(SensorSize sensor, RtpEventFormat format)
    : sensor_(sensor),
      format_(format),
      reader_(make_evt3_reader(sensor)),
      batch_(std::make_unique<Batch>(corruption_)) {}

void RtpUnpacker::change(SensorSize sensor, RtpEventFormat format) {
  reader_ = make_evt3_reader(sensor);
  sensor_ = sensor;
  format_ = format;
}

void RtpUnpacker::reset() {
  position_.reset();
  close_interval();
  is_discontinuous_ = true;
}

void RtpUnpacker::close_interval() {
  if (interval_) end_ = interval_->start + interval_->duration;
  interval_.reset();
  events_.clear();
  is_discontinuous_ = false;
}

bool RtpUnpacker::is_plausible(std::span<const std::uint8_t> payload) const {
  const auto header = RtpPayloadHeader::read(payload);
  return header && header->format == format_;
}

std::optional<RtpPayloadHeader> RtpUnpacker::accept(const RtpPacket& packet) {
  const auto header = RtpPayloadHeader::read(packet.payload);
  if (!header || header->format != format_) {
    ++statistics_.rejected_packets;
    return std::nullopt;
  }
  if (is_late(packet)) {
    ++statistics_.late_packets;
    return std::nullopt;
  }
  bool is_valid = decode(*header, packet.payload.subspan(RtpPayloadHeader::size));
  if (is_valid && !decoded_.empty() && !events_.empty() && is_of_interval(packet, *header))
    is_valid = decoded_.front().t >= events_.back().t &&
               events_.size() + decoded_.size() <= max_rtp_interval_events;
  if (is_valid) return header;
  ++statistics_.rejected_packets;
  return std::nullopt;
}

bool RtpUnpacker::is_late(const RtpPacket& packet) {
  const auto number = packet.sequence_number;
  if (!position_ || packet.ssrc != position_->ssrc) return false;
  const auto ahead = static_cast<std::int16_t>(number - position_->next_sequence_number);
  if (ahead >= 0) return false;
  late_in_a_row_ = number == next_late_ ? late_in_a_row_ + 1 : 1;
  next_late_ = static_cast<std::uint16_t>(number + 1);
  if (late_in_a_row_ < max_late_in_a_row) return true;
  position_.reset();
  return false;
}

bool RtpUnpacker::is_of_interval(const RtpPacket& packet, const RtpPayloadHeader& header) const {
  return interval_ && position_ && position_->ssrc == packet.ssrc &&
         header.start == interval_->start && header.duration == interval_->duration;
}

void RtpUnpacker::append(const RtpPacket& packet, const RtpPayloadHeader& header) {
  follow(packet, header);
  if (!interval_) {
    is_discontinuous_ |= header.start < end_;
    interval_ = header;
    arrival_ = packet.arrival;
  }
  events_.insert(events_.end(), decoded_.begin(), decoded_.end());
  ++statistics_.packets;
  statistics_.bytes += packet.payload.size();
  statistics_.events += header.event_count;
}

void RtpUnpacker::follow(const RtpPacket& packet, const RtpPayloadHeader& header) {
  late_in_a_row_ = 0;
  if (!position_ || position_->ssrc != packet.ssrc) {
    is_discontinuous_ = true;
  } else {
    const auto packets =
        static_cast<std::uint16_t>(packet.sequence_number - position_->next_sequence_number);
    const auto events = static_cast<std::int32_t>(header.first_event - position_->next_event);
    statistics_.lost_packets += packets;
    // A negative number is that of a sender that started over.
    if (events > 0) statistics_.lost_events += static_cast<std::uint32_t>(events);
    is_discontinuous_ |= packets != 0 || events != 0;
  }
  position_ = {.ssrc = packet.ssrc,
               .next_sequence_number = static_cast<std::uint16_t>(packet.sequence_number + 1),
               .next_event = header.first_event + header.event_count};
}

bool RtpUnpacker::decode(const RtpPayloadHeader& header, std::span<const std::uint8_t> body) {
  decoded_.clear();
  return header.format == RtpEventFormat::evt3 ? decode_evt3(header, body)
                                               : decode_xytp(header, body);
}

bool RtpUnpacker::decode_evt3(const RtpPayloadHeader& header, std::span<const std::uint8_t> words) {
  reader_->restore({});
  corruption_ = {};
  batch_->triggers = &triggers_;
  batch_->start = words.data();
  const auto* from = words.data();
  const auto* const to = from + words.size();
  while (from != to) {
    batch_->end = batch_->begin();
    from = reader_->read(from, to, *batch_);
    triggers_.clear();
    for (const auto* event = batch_->begin(); event != batch_->end; ++event)
      if (!decode(header, static_cast<std::uint64_t>(event->t), event->x, event->y_p)) return false;
  }
  return corruption_.places == 0 && corruption_.outside == 0 &&
         decoded_.size() == header.event_count;
}

bool RtpUnpacker::decode_xytp(const RtpPayloadHeader& header, std::span<const std::uint8_t> body) {
  for (std::size_t i = 0; i < body.size(); i += sizeof(Event)) {
    const auto event = little_endian<Event>(body.data() + i);
    if (event.x >= sensor_.width || event.y() >= sensor_.height ||
        !decode(header, event.t, event.x, event.y_p))
      return false;
  }
  return true;
}

/// Decodes an event at `t`, relative to the header's base.
bool RtpUnpacker::decode(const RtpPayloadHeader& header, std::uint64_t t, std::uint16_t x,
                         std::uint16_t y_p) {
  t += header.base;
  const auto latest = (header.start + header.duration) / 1000 - header.start / 1000;
  if (t > static_cast<std::uint64_t>(latest) || (!decoded_.empty() && t < decoded_.back().t))
    return false;
  decoded_.push_back({static_cast<std::uint32_t>(t), x, y_p});
  return true;
}

}  // namespace eventcamera
