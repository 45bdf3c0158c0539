// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/unit_decoder.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

/// The parts of an RTP packet that the unpacker needs.
struct RtpPacket {
  std::uint32_t ssrc;
  std::uint16_t sequence_number;
  bool marker;  ///< last packet of its interval
  std::span<const std::uint8_t> payload;
  std::uint64_t arrival = 0;  ///< nanoseconds, on any clock; `no_arrival` if unknown
};

inline constexpr std::uint64_t no_arrival = std::numeric_limits<std::uint64_t>::max();

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

/// Decodes the payloads of RTP packets, and joins the packets of each interval. Drops packets that
/// are not valid in every detail, and packets that are late, so that every interval and event is in
/// the sender's order.
///
/// A new SSRC is followed at once: the sender restarted. If the SSRC before it continues, there are
/// two senders, and the new one is rejected until the other has been silent for a second.
class RtpUnpacker {
 public:
  RtpUnpacker(SensorSize sensor, RtpEventFormat format);

  /// Changes the sensor or format; call flush() first.
  void change(SensorSize sensor, RtpEventFormat format);

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
    if (is_late(packet)) {
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
  /// Position in the stream of a sender.
  struct Position {
    std::uint32_t ssrc;
    std::uint16_t next_sequence_number;
    std::uint32_t next_event;

    /// Number of packets that are missing before this one; negative after the expected one.
    int packets_before(const RtpPacket& packet) const {
      return static_cast<std::int16_t>(packet.sequence_number - next_sequence_number);
    }
  };

  /// Whether a second sender sent the packet, and the first one is not silent.
  bool is_of_second_sender(const RtpPacket& packet) const;
  /// Makes the sender of the packet the current one.
  void change_sender(const RtpPacket& packet);
  bool is_late(const RtpPacket& packet);
  /// Whether the decoded packet belongs to the current interval.
  bool is_of_interval(const RtpPacket& packet) const;
  /// Whether the decoded events may follow those of the current interval.
  bool continues_interval() const;
  bool decode_events(std::span<const std::uint8_t> body);
  bool decode_evt3(std::span<const std::uint8_t> words);
  bool decode_xytp(std::span<const std::uint8_t> body);
  bool decode(std::uint64_t t, std::uint16_t x, std::uint16_t y_p);
  /// Adds the decoded events to the interval.
  void add(const RtpPacket& packet);
  /// Counts what was lost before a packet.
  void follow(const RtpPacket& packet);
  void close_interval();

  SensorSize sensor_;
  RtpEventFormat format_;
  std::unique_ptr<UnitDecoder> decoder_;  ///< of EVT3 words
  Corruption corruption_;                 ///< of the current packet
  Decoded words_;                         ///< of the current packet, with times of the words
  RtpPayloadHeader header_;               ///< of the current packet
  std::vector<Event> decoded_;            ///< of the current packet

  std::optional<Position> position_;
  std::uint64_t heard_ = no_arrival;             ///< arrival of the last packet
  std::optional<Position> previous_;             ///< in the stream of the sender before
  std::vector<std::uint32_t> second_senders_{};  ///< SSRCs, oldest first
  std::uint16_t next_late_ = 0;  ///< sequence number that continues the last late packet
  int late_in_a_row_ = 0;
  std::optional<RtpPayloadHeader> interval_;  ///< header of the current interval's first packet
  std::vector<Event> events_;                 ///< of the current interval
  std::uint64_t arrival_ = 0;                 ///< of the current interval
  Nanoseconds end_ = 0;                       ///< of the last interval
  bool is_discontinuous_ = true;
  RtpStatistics statistics_;
};

}  // namespace eventcamera
