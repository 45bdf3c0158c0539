// SPDX-License-Identifier: LGPL-2.1-or-later
// Prints streams for rtp_decoder.py: their sensors, the payloads of their packets, and their
// events.
#include "tests/wire/rtp_packets.hpp"

#include <cinttypes>
#include <cstdio>

using namespace eventcamera;

int main() {
  unsigned seed = 0;
  for (const auto format : {RtpEventFormat::evt3, RtpEventFormat::xytp}) {
    for (const SensorSize size : {SensorSize{1, 1}, {31, 7}, {346, 260}, {2048, 2048}}) {
      std::printf("stream %d %d\n", size.width, size.height);
      const auto intervals = rtp_packets::random_intervals(size, 30, ++seed);
      RtpPacker packer(size, format);
      for (const auto& packet : rtp_packets::packets_of(intervals, packer, 564, 0)) {
        std::printf("packet %d ", packet.marker ? 1 : 0);
        for (const unsigned byte : packet.payload) std::printf("%02x", byte);
        std::printf("\n");
      }
      for (const auto& [start, duration, events] : intervals) {
        std::printf("interval %" PRId64 " %" PRId64 "\n", start, duration);
        for (const auto& event : events)
          std::printf("event %" PRId64 " %d %d %d\n", start / 1000 + event.t, event.x, event.y(),
                      event.polarity() == Polarity::on ? 1 : 0);
      }
    }
  }
}
