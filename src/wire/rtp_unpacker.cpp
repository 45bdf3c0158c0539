// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_unpacker.hpp"

namespace eventcamera {

void RtpUnpacker::reset() {
  sender_ = {};
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
  bool is_valid = decoder_.decode(packet.payload);
  // A late packet precedes the events of its interval.
  if (is_valid && is_of_interval(packet) && sender_.is_next(packet))
    is_valid = continues_interval();
  if (is_valid && sender_.is_of_second_sender(packet)) {
    ++statistics_.second_sender_packets;
    is_valid = false;
  }
  if (!is_valid) count_rejected();
  return is_valid;
}

bool RtpUnpacker::continues_interval() const {
  const auto events = decoder_.events();
  return events.empty() || events_.empty() ||
         (events.front().t >= events_.back().t &&
          events_.size() + events.size() <= max_rtp_interval_events);
}

bool RtpUnpacker::is_of_interval(const RtpPacket& packet) const {
  const auto& header = decoder_.header();
  return interval_ && sender_.is_current(packet) && header.start == interval_->start &&
         header.duration == interval_->duration;
}

void RtpUnpacker::add(const RtpPacket& packet) {
  const auto& header = decoder_.header();
  const auto loss = sender_.follow(packet, header);
  is_discontinuous_ |= loss.is_discontinuous;
  if (!interval_) {
    is_discontinuous_ |= header.start < end_;
    interval_ = header;
    arrival_ = packet.arrival;
  }
  events_.insert(events_.end(), decoder_.events().begin(), decoder_.events().end());
  ++statistics_.packets;
  statistics_.bytes += packet.payload.size();
  statistics_.events += header.event_count;
  statistics_.lost_packets += loss.packets;
  statistics_.lost_events += loss.events;
}

}  // namespace eventcamera
