// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/wire/rtp_packet.hpp"
#include "src/wire/rtp_payload.hpp"
#include "src/wire/rtp_payload_decoder.hpp"
#include "src/wire/rtp_sender_tracker.hpp"

namespace eventcamera {

/// An interval, with those of its events that arrived.
struct RtpInterval {
  Nanoseconds start;
  Nanoseconds duration;
  std::span<const Event> events;  ///< relative to `start`, rounded down to microseconds
  std::uint64_t arrival;          ///< of its first packet
  bool is_discontinuous;          ///< packets were lost before or in it, or the stream starts over
};

/// Counters of a receiver. Events sent - events = lost_events, once a later packet has arrived.
struct RtpStatistics {
  std::uint64_t packets = 0;       ///< valid and in order
  std::uint64_t bytes = 0;         ///< their payloads
  std::uint64_t events = 0;        ///< received
  std::uint64_t lost_packets = 0;  ///< by sequence number
  std::uint64_t lost_events = 0;   ///< by event number
  std::uint64_t late_packets = 0;  ///< duplicate or out of order; dropped
  /// Not of this format, sensor or sender, or corrupt; dropped.
  std::uint64_t rejected_packets = 0;
  std::uint64_t second_sender_packets = 0;  ///< of these, only the sender is wrong
};

/// Joins the packets of each interval. Drops packets that are not valid in every detail, those of a
/// second sender, and those that are late, so that every interval and event is in the sender's
/// order.
class RtpUnpacker {
 public:
  RtpUnpacker(SensorSize sensor, RtpEventFormat format) : decoder_(sensor, format) {}

  /// Changes the sensor or format; call flush() first.
  void change(SensorSize sensor, RtpEventFormat format) {
    decoder_ = RtpPayloadDecoder(sensor, format);
  }

  /// Decodes a packet, and appends it if it is valid.
  template <class Take>
  void push(const RtpPacket& packet, const Take& take) {
    if (decode(packet)) append(packet, take);
  }

  /// Decodes the events of a packet. False if it is not valid in every detail: it is counted as
  /// rejected, and changes nothing else.
  bool decode(const RtpPacket& packet);

  /// Appends the packet that was decoded last, unless it is late. Calls take(RtpInterval) for each
  /// interval that ends with this packet or ended before it. The events are valid during the call
  /// only.
  template <class Take>
  void append(const RtpPacket& packet, const Take& take) {
    if (sender_.is_late(packet)) {
      count_late();
      return;
    }
    if (!is_of_interval(packet)) flush(take);
    add(packet);
    if (packet.marker) flush(take);
  }

  /// Ends the current interval, if any.
  template <class Take>
  void flush(const Take& take) {
    if (!interval_) return;
    take(RtpInterval{interval_->start, interval_->duration, events_, arrival_, is_discontinuous_});
    close_interval();
  }

  /// Forgets the stream; the next packet starts a new one. Statistics continue.
  void reset();

  /// Counts a packet that was dropped before decode(): not RTP.
  void count_rejected() { ++statistics_.rejected_packets; }
  /// Counts a packet that was dropped before append(): late.
  void count_late() { ++statistics_.late_packets; }

  const RtpStatistics& statistics() const { return statistics_; }

 private:
  /// Whether the decoded packet belongs to the current interval.
  bool is_of_interval(const RtpPacket& packet) const;
  /// Whether the decoded events may follow those of the current interval.
  bool continues_interval() const;
  /// Adds the decoded events to the interval.
  void add(const RtpPacket& packet);
  void close_interval();

  RtpPayloadDecoder decoder_;
  RtpSenderTracker sender_;
  std::optional<RtpPayloadHeader> interval_;  ///< header of the current interval's first packet
  std::vector<Event> events_;                 ///< of the current interval
  std::uint64_t arrival_ = 0;                 ///< of the current interval
  Nanoseconds end_ = 0;                       ///< of the last interval
  bool is_discontinuous_ = true;
  RtpStatistics statistics_;
};

}  // namespace eventcamera
