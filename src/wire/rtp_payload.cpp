// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/rtp_payload.hpp"

#include "src/core/byte_order.hpp"

namespace eventcamera {
namespace {

constexpr unsigned version = 1;
constexpr auto big = std::endian::big;

/// True if `size` bytes can hold `count` events.
bool fits(RtpEventFormat format, std::size_t size, std::size_t count) {
  if (format == RtpEventFormat::xytp) return size == count * sizeof(Event);
  return size % 2 == 0 && (count == 0 ? size == 0 : size >= 2 && count <= size / 2 * 12);
}

}  // namespace

void RtpPayloadHeader::write(std::uint8_t* to) const {
  to[0] = static_cast<std::uint8_t>(version << 4 | static_cast<unsigned>(format));
  to[1] = 0;
  store(event_count, to + 2, big);
  store(first_event, to + 4, big);
  store(static_cast<std::uint64_t>(start), to + 8, big);
  store(static_cast<std::uint64_t>(duration), to + 16, big);
  store(base, to + 24, big);
}

std::optional<RtpPayloadHeader> RtpPayloadHeader::read(std::span<const std::uint8_t> payload) {
  if (payload.size() < size) return std::nullopt;
  const auto* bytes = payload.data();
  if (bytes[0] >> 4 != version || (bytes[0] & 15) > 1 || bytes[1] != 0) return std::nullopt;
  const RtpPayloadHeader header{
      .format = static_cast<RtpEventFormat>(bytes[0] & 15),
      .event_count = load<std::uint16_t>(bytes + 2, big),
      .first_event = load<std::uint32_t>(bytes + 4, big),
      .start = static_cast<Nanoseconds>(load<std::uint64_t>(bytes + 8, big)),
      .duration = static_cast<Nanoseconds>(load<std::uint64_t>(bytes + 16, big)),
      .base = load<std::uint32_t>(bytes + 24, big)};
  if (header.start < 0 || header.start > max_rtp_start || header.duration < 0 ||
      header.duration > max_interval ||
      !fits(header.format, payload.size() - size, header.event_count))
    return std::nullopt;
  return header;
}

}  // namespace eventcamera
