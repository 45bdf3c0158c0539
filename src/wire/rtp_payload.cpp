// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {
namespace {

constexpr unsigned version = 1;

template <class Number>
std::uint8_t* put(Number number, std::uint8_t* to) {
  for (auto left = sizeof number; left-- > 0; ++to)
    *to = static_cast<std::uint8_t>(static_cast<std::uint64_t>(number) >> 8 * left);
  return to;
}

template <class Number>
Number big_endian(const std::uint8_t* bytes) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) number = number << 8 | bytes[i];
  return static_cast<Number>(number);
}

/// True if `size` bytes can hold `count` events.
bool fits(RtpEventFormat format, std::size_t size, std::size_t count) {
  if (format == RtpEventFormat::xytp) return size == count * sizeof(Event);
  return size % 2 == 0 && (count == 0 ? size == 0 : size >= 2 && count <= size / 2 * 12);
}

}  // namespace

void RtpPayloadHeader::write(std::uint8_t* to) const {
  to = put(static_cast<std::uint8_t>(version << 4 | static_cast<unsigned>(format)), to);
  to = put(std::uint8_t{0}, to);
  to = put(event_count, to);
  to = put(first_event, to);
  to = put(start, to);
  to = put(duration, to);
  put(base, to);
}

std::optional<RtpPayloadHeader> RtpPayloadHeader::read(std::span<const std::uint8_t> payload) {
  if (payload.size() < size) return std::nullopt;
  const auto* bytes = payload.data();
  if (bytes[0] >> 4 != version || (bytes[0] & 15) > 1 || bytes[1] != 0) return std::nullopt;
  const RtpPayloadHeader header{.format = static_cast<RtpEventFormat>(bytes[0] & 15),
                                .event_count = big_endian<std::uint16_t>(bytes + 2),
                                .first_event = big_endian<std::uint32_t>(bytes + 4),
                                .start = big_endian<Nanoseconds>(bytes + 8),
                                .duration = big_endian<Nanoseconds>(bytes + 16),
                                .base = big_endian<std::uint32_t>(bytes + 24)};
  if (header.start < 0 || header.start > max_rtp_start || header.duration < 0 ||
      header.duration > max_interval ||
      !fits(header.format, payload.size() - size, header.event_count))
    return std::nullopt;
  return header;
}

}  // namespace eventcamera
