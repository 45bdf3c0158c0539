// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_payload_decoder.hpp"

#include "src/core/byte_order.hpp"
#include "src/formats/evt/words.hpp"

namespace eventcamera {

RtpPayloadDecoder::RtpPayloadDecoder(SensorSize sensor, RtpEventFormat format)
    : sensor_(sensor), format_(format), evt3_(make_evt3_unit_decoder(sensor)) {}

bool RtpPayloadDecoder::decode(std::span<const std::uint8_t> payload) {
  const auto header = RtpPayloadHeader::read(payload);
  if (!header || header->format != format_) return false;
  header_ = *header;
  events_.clear();
  const auto body = payload.subspan(RtpPayloadHeader::size);
  return format_ == RtpEventFormat::evt3 ? decode_evt3(body) : decode_xytp(body);
}

bool RtpPayloadDecoder::decode_evt3(std::span<const std::uint8_t> words) {
  evt3_->restore({});
  corruption_ = {};
  words_.events.clear();
  words_.triggers.clear();
  Batch batch(corruption_);
  batch.start = words.data();
  const auto* from = words.data();
  const auto* const to = from + words.size();
  while (from != to) {
    batch.open(words_, static_cast<std::size_t>(to - from));
    from = evt3_->read(from, to, batch);
    for (const auto& event : batch.close())
      if (!take(static_cast<std::uint64_t>(event.t), event.x, event.y_p)) return false;
  }
  return corruption_.places == 0 && corruption_.outside == 0 &&
         events_.size() == header_.event_count;
}

bool RtpPayloadDecoder::decode_xytp(std::span<const std::uint8_t> body) {
  for (std::size_t i = 0; i < body.size(); i += sizeof(Event)) {
    const auto event = little_endian<Event>(body.data() + i);
    if (event.x >= sensor_.width || event.y() >= sensor_.height ||
        !take(event.t, event.x, event.y_p))
      return false;
  }
  return true;
}

/// Takes an event at `t`, relative to the header's base.
bool RtpPayloadDecoder::take(std::uint64_t t, std::uint16_t x, std::uint16_t y_p) {
  t += header_.base;
  const auto latest = (header_.start + header_.duration) / 1000 - header_.start / 1000;
  if (t > static_cast<std::uint64_t>(latest) || (!events_.empty() && t < events_.back().t))
    return false;
  events_.push_back({static_cast<std::uint32_t>(t), x, y_p});
  return true;
}

}  // namespace eventcamera
