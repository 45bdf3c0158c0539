// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

/// Packs events into RTP payloads, each of which can be decoded by itself.
class RtpPacker {
 public:
  /// Minimum of max_size.
  static constexpr std::size_t min_size = RtpPayloadHeader::size + 16;

  /// `first_event` is the number of the first event. Throws std::invalid_argument if the format
  /// does not support the sensor.
  RtpPacker(SensorSize sensor, RtpEventFormat format, std::uint32_t first_event = 0);

  /// Calls take(payload, is_last) for each packet of an interval, at least one. Events must be
  /// sorted and within the sensor, at most max_rtp_interval_events, and their times relative to
  /// `start`, rounded down to microseconds. No payload is longer than `max_size`. A payload is
  /// valid during the call only.
  template <class Take>
  void pack(Nanoseconds start, Nanoseconds duration, std::span<const Event> events,
            std::size_t max_size, const Take& take) {
    do {
      events = events.subspan(pack_one(start, duration, events, max_size));
      take(std::span<const std::uint8_t>(payload_), events.empty());
    } while (!events.empty());
  }

  /// Number of the next event, modulo 2^32.
  std::uint32_t next_event() const { return next_event_; }

 private:
  /// Packs one payload, and returns the number of its events.
  std::size_t pack_one(Nanoseconds start, Nanoseconds duration, std::span<const Event> events,
                       std::size_t max_size);
  std::size_t append_evt3(std::span<const Event> events, std::size_t max_size);
  std::size_t append_xytp(std::span<const Event> events, std::size_t max_size);

  int width_;
  RtpEventFormat format_;
  std::uint32_t next_event_;
  std::vector<std::uint8_t> payload_;
};

}  // namespace eventcamera
