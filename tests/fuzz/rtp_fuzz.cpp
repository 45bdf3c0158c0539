// SPDX-License-Identifier: LGPL-2.1-or-later
// RTP packets. The first byte is the format; each packet follows four bytes: marker (bit 0) and
// SSRC, sequence number, and size of its payload.
#include "src/core/byte_order.hpp"
#include "src/wire/rtp_unpacker.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  using fuzz::require;
  if (size == 0) return 0;
  constexpr SensorSize sensor{640, 480};
  RtpUnpacker unpacker(sensor, static_cast<RtpEventFormat>(data[0] & 1));
  std::uint64_t packets = 0;
  std::uint64_t events = 0;
  const auto take = [&](const RtpInterval& interval) {
    require(interval.start >= 0 && interval.duration >= 0, "an interval has a time");
    require(interval.events.size() <= max_rtp_interval_events, "memory is bounded");
    const auto end = (interval.start + interval.duration) / 1000;
    auto before = interval.start / 1000;
    for (const auto& event : interval.events) {
      const auto t = interval.start / 1000 + event.t;
      require(event.x < sensor.width && event.y() < sensor.height, "events are within the sensor");
      require(t >= before && t <= end, "events are sorted and within their interval");
      before = t;
    }
    events += interval.events.size();
  };
  for (std::size_t at = 1; at + 4 <= size; ++packets) {
    const auto* packet = data + at;
    const auto length = std::min<std::size_t>(packet[3], size - at - 4);
    // Sanitizers detect reads past the end.
    const std::vector<std::uint8_t> payload(packet + 4, packet + 4 + length);
    unpacker.push({.ssrc = packet[0] / 2U,
                   .sequence_number = little_endian<std::uint16_t>(packet + 1),
                   .marker = packet[0] % 2 == 1,
                   .payload = payload},
                  take);
    at += 4 + length;
  }
  unpacker.flush(take);
  const auto& counted = unpacker.statistics();
  require(counted.packets + counted.late_packets + counted.rejected_packets == packets,
          "every packet is counted");
  require(counted.events == events, "every event is counted");
  require(events <= 6 * size, "memory is bounded by the bytes");
  return 0;
}
