// SPDX-License-Identifier: LGPL-2.1-or-later
// Streams of intervals, and their RTP packets.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "src/wire/rtp_packer.hpp"
#include "src/wire/rtp_unpacker.hpp"

namespace eventcamera::rtp_packets {

struct Interval {
  Nanoseconds start;
  Nanoseconds duration;
  std::vector<Event> events;

  friend bool operator==(const Interval&, const Interval&) = default;
};

struct Packet {
  std::uint16_t sequence_number;
  bool marker;
  std::vector<std::uint8_t> payload;

  RtpPacket view(std::uint32_t ssrc = 1) const { return {ssrc, sequence_number, marker, payload}; }
};

/// Intervals that follow one another, with bursts in rows, scattered events, pauses and silence.
/// Starts are not multiples of a microsecond.
inline std::vector<Interval> random_intervals(SensorSize size, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](std::int64_t limit) {
    return std::uniform_int_distribution<std::int64_t>(0, limit - 1)(random);
  };
  std::vector<Interval> intervals;
  Nanoseconds start = below(2) == 0 ? below(1'000'000) : 1'700'000'000'000'000'123;
  for (std::size_t i = 0; i < count; ++i) {
    Interval interval{start, 1 + below(below(8) == 0 ? 40'000'000'000 : 40'000'000), {}};
    const auto latest = (start + interval.duration) / 1000 - start / 1000;
    const auto wanted = static_cast<std::size_t>(below(4) == 0 ? 0 : below(3000));
    for (Microseconds t = 0; interval.events.size() < wanted;) {
      const auto y = static_cast<int>(below(size.height));
      const auto polarity = below(2) == 1 ? Polarity::on : Polarity::off;
      auto x = static_cast<int>(below(size.width));
      for (auto burst = below(3) == 0 ? below(60) : 1; burst > 0 && x < size.width; --burst, ++x)
        interval.events.push_back(Event::at(x, y, static_cast<std::uint32_t>(t), polarity));
      t = std::min(latest, t + below(below(20) == 0 ? std::max(latest / 4, Microseconds{1}) : 30));
    }
    start += interval.duration;
    intervals.push_back(std::move(interval));
  }
  return intervals;
}

inline std::vector<Packet> packets_of(std::span<const Interval> intervals, RtpPacker& packer,
                                      std::size_t max_size, std::uint16_t sequence_number) {
  std::vector<Packet> packets;
  for (const auto& interval : intervals)
    packer.pack(interval.start, interval.duration, interval.events, max_size,
                [&](std::span<const std::uint8_t> payload, bool is_last) {
                  packets.push_back({sequence_number++, is_last, {payload.begin(), payload.end()}});
                });
  return packets;
}

}  // namespace eventcamera::rtp_packets
