// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/unit_stream_decoder.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

inline constexpr std::uint64_t no_arrival = std::numeric_limits<std::uint64_t>::max();

/// The parts of an RTP packet that a receiver of events needs.
struct RtpPacket {
  std::uint32_t ssrc;
  std::uint16_t sequence_number;
  bool marker;  ///< last packet of its interval
  std::span<const std::uint8_t> payload;
  std::uint64_t arrival = 0;  ///< nanoseconds, on any clock; `no_arrival` if unknown
};

/// Follows the packets of one sender.
///
/// A new SSRC is followed at once: the sender restarted. If the SSRC before it continues, there are
/// two senders, and the new one is rejected until the other has been silent for a second.
class RtpSenderTracker {
 public:
  /// Packets and events missing before a packet.
  struct Loss {
    std::uint32_t packets = 0;  ///< by sequence number
    std::uint32_t events = 0;   ///< by event number
    bool is_discontinuous = true;
  };

  /// Whether the current sender sent the packet.
  bool is_current(const RtpPacket& packet) const {
    return position_ && position_->ssrc == packet.ssrc;
  }
  /// Whether the current sender sent the packet after those that were followed.
  bool is_next(const RtpPacket& packet) const {
    return is_current(packet) && position_->packets_before(packet) >= 0;
  }
  /// Whether a second sender sent the packet, and the first one is not silent.
  bool is_of_second_sender(const RtpPacket& packet) const;

  /// Whether the current sender sent the packet before those that were followed. After many of
  /// them in a row, the sender must have restarted: they are no longer late.
  bool is_late(const RtpPacket& packet) const;

  void drop_late(const RtpPacket& packet);

  /// Makes the sender of the packet, which is not late, the current one.
  Loss follow(const RtpPacket& packet, const RtpPayloadHeader& header);

 private:
  struct Position {
    std::uint32_t ssrc;
    std::uint16_t next_sequence_number;
    std::uint32_t next_event;

    /// Number of packets that are missing before this one; negative after the expected one.
    int packets_before(const RtpPacket& packet) const {
      return static_cast<std::int16_t>(packet.sequence_number - next_sequence_number);
    }
  };

  /// Number of consecutive late packets, with this one.
  int late_in_a_row(const RtpPacket& packet) const {
    return packet.sequence_number == next_late_ ? late_in_a_row_ + 1 : 1;
  }
  void change_sender(const RtpPacket& packet);

  std::optional<Position> position_;
  std::uint64_t heard_ = no_arrival;           ///< arrival of the last packet
  std::optional<Position> previous_;           ///< in the stream of the sender before
  std::vector<std::uint32_t> second_senders_;  ///< SSRCs, oldest first
  std::uint16_t next_late_ = 0;  ///< sequence number that continues the last late packet
  int late_in_a_row_ = 0;
};

/// An interval, with the events that arrived.
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
  std::uint64_t second_sender_packets = 0;  ///< rejected only because of their sender
};

/// Joins the packets of each interval. Drops packets that are invalid, late, or of a second sender,
/// so every interval and event is in the sender's order.
class RtpUnpacker {
 public:
  RtpUnpacker(SensorSize sensor, RtpEventFormat format);

  /// Changes the sensor or format; call flush() first.
  void change(SensorSize sensor, RtpEventFormat format);

  /// Appends a packet, unless it is invalid or late. Calls receive(RtpInterval) for each interval
  /// that ends with this packet or ended before it. The events are valid during the call only.
  template <class Receive>
  void push(const RtpPacket& packet, const Receive& receive) {
    const auto header = decode(packet);
    if (!header) {
      ++statistics_.rejected_packets;
    } else if (sender_.is_late(packet)) {
      sender_.drop_late(packet);
      ++statistics_.late_packets;
    } else {
      if (!is_of_interval(packet, *header)) flush(receive);
      add(packet, *header);
      if (packet.marker) flush(receive);
    }
  }

  /// Ends the current interval, if any.
  template <class Receive>
  void flush(const Receive& receive) {
    if (!interval_) return;
    receive(RtpInterval{interval_->start, interval_->duration,
                        std::span(events_).first(event_count_), arrival_, is_discontinuous_});
    close_interval();
  }

  /// Forgets the stream; the next packet starts a new one. Statistics continue.
  void reset();

  const RtpStatistics& statistics() const { return statistics_; }

 private:
  /// Appends a packet's events to the current interval's. False, without any change, if
  /// any part of the packet is invalid.
  std::optional<RtpPayloadHeader> decode(const RtpPacket& packet);
  bool decode_evt3(const RtpPayloadHeader& header, std::span<const std::uint8_t> words);
  bool decode_xytp(const RtpPayloadHeader& header, std::span<const std::uint8_t> bytes);
  /// Whether a packet is the next one of the current interval.
  bool is_of_interval(const RtpPacket& packet, const RtpPayloadHeader& header) const;
  /// Whether the decoded events may follow the current interval's.
  bool continues_interval() const;
  void add(const RtpPacket& packet, const RtpPayloadHeader& header);
  void close_interval();

  SensorSize sensor_;
  RtpEventFormat format_;
  std::unique_ptr<UnitDecoder> evt3_;
  Corruption corruption_;
  Decoded words_;  ///< events of EVT3 words, with their times

  RtpSenderTracker sender_;
  std::optional<RtpPayloadHeader> interval_;  ///< header of the current interval's first packet
  std::vector<Event> events_;                 ///< of the current interval and the last packet
  std::size_t event_count_ = 0;               ///< events of the current interval
  std::uint64_t arrival_ = 0;                 ///< of the current interval
  Nanoseconds end_ = 0;                       ///< of the last interval
  bool is_discontinuous_ = true;
  RtpStatistics statistics_;
};

}  // namespace eventcamera
