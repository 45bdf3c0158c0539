// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_packer.hpp"

#include <algorithm>
#include <stdexcept>

#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"

namespace eventcamera {
namespace {

/// The header has 16 bits for the number of events.
constexpr std::size_t max_events = 0xffff;

/// Maximum number of TIME_HIGH words for a pause. A longer pause ends the packet, because another
/// header takes no more bytes.
constexpr std::uint64_t max_pause_words = 32;

/// The words of a packet hold 24 bits of a time.
constexpr std::uint64_t max_time = 0xffffff;

}  // namespace

RtpPacker::RtpPacker(SensorSize sensor, RtpEventFormat format, std::uint32_t first_event)
    : width_(sensor.width), format_(format), next_event_(first_event) {
  if (format == RtpEventFormat::evt3 && std::max(sensor.width, sensor.height) > max_evt_side)
    throw std::invalid_argument("EVT3 words support sensors of 1x1 to 2048x2048 pixels");
}

std::size_t RtpPacker::pack_one(Nanoseconds start, Nanoseconds duration,
                                std::span<const Event> events, std::size_t max_size) {
  if (max_size < min_size) throw std::invalid_argument("no space for events in a packet");
  payload_.assign(RtpPayloadHeader::size, 0);
  const bool is_evt3 = format_ == RtpEventFormat::evt3;
  const auto count = is_evt3 ? append_evt3(events, max_size) : append_xytp(events, max_size);
  const RtpPayloadHeader header{
      .format = format_,
      .event_count = static_cast<std::uint16_t>(count),
      .first_event = next_event_,
      .start = start,
      .duration = duration,
      .base = is_evt3 && !events.empty() ? events.front().t : 0,
  };
  header.write(payload_.data());
  next_event_ += static_cast<std::uint32_t>(count);
  return count;
}

std::size_t RtpPacker::append_evt3(std::span<const Event> events, std::size_t max_size) {
  Evt3Words state(width_);
  WordWriter<std::uint16_t> words(payload_);
  const auto max_words =
      std::min(events.size(), max_events) * (max_pause_words + Evt3Words::max_words);
  words.reserve(std::min((max_size - payload_.size()) / sizeof(std::uint16_t), max_words));
  std::size_t count = 0;
  while (count < events.size() && count + Evt3Words::max_events <= max_events) {
    const std::uint64_t time = events[count].t - events.front().t;
    const auto steps = state.steps_to(time);
    const auto needed = (steps + Evt3Words::max_words) * sizeof(std::uint16_t);
    if (steps > max_pause_words || time > max_time || words.size() + needed > max_size) break;
    count += state.write(events.subspan(count), time, words);
  }
  return count;
}

std::size_t RtpPacker::append_xytp(std::span<const Event> events, std::size_t max_size) {
  const auto count =
      std::min({events.size(), (max_size - payload_.size()) / sizeof(Event), max_events});
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(events.data());
  payload_.insert(payload_.end(), bytes, bytes + count * sizeof(Event));
  return count;
}

}  // namespace eventcamera
