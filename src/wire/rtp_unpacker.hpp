// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/evt/words.hpp"
#include "src/formats/unit_stream_decoder.hpp"
#include "src/wire/rtp_payload.hpp"
#include "src/wire/rtp_unpacker.hpp"

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
  bool is_of_second_sender(const RtpPacket& packet) const {
    if (!position_ || std::ranges::find(second_senders_, packet.ssrc) == second_senders_.end())
      return false;
    return packet.arrival != no_arrival && heard_ != no_arrival &&
           packet.arrival < heard_ + max_silence;
  }

  /// Whether the current sender sent the packet before those that were followed. After many of
  /// them in a row, the sender must have restarted: they are no longer late.
  bool is_late(const RtpPacket& packet) const {
    return is_current(packet) && !is_next(packet) && late_in_a_row(packet) < max_late_in_a_row;
  }

  /// Counts a late packet.
  void drop_late(const RtpPacket& packet) {
    late_in_a_row_ = late_in_a_row(packet);
    next_late_ = static_cast<std::uint16_t>(packet.sequence_number + 1);
  }

  /// Makes the sender of the packet, which is not late, the current one.
  Loss follow(const RtpPacket& packet, const RtpPayloadHeader& header) {
    Loss loss;
    if (is_next(packet)) {
      loss.packets =
          static_cast<std::uint16_t>(packet.sequence_number - position_->next_sequence_number);
      const auto events = static_cast<std::int32_t>(header.first_event - position_->next_event);
      // Negative if the sender has restarted.
      loss.events = static_cast<std::uint32_t>(std::max(events, 0));
      loss.is_discontinuous = loss.packets != 0 || events != 0;
    } else if (position_ && !is_current(packet)) {
      change_sender(packet);
    }
    late_in_a_row_ = 0;
    heard_ = packet.arrival;
    position_ = {.ssrc = packet.ssrc,
                 .next_sequence_number = static_cast<std::uint16_t>(packet.sequence_number + 1),
                 .next_event = header.first_event + header.event_count};
    return loss;
  }

 private:
  /// Number of consecutive late packets after which the sender is assumed to have restarted.
  static constexpr int max_late_in_a_row = 16;

  /// Silence after which a sender is assumed to have ended, nanoseconds.
  static constexpr std::uint64_t max_silence = 1'000'000'000;

  /// Number of second senders that are remembered.
  static constexpr std::size_t max_second_senders = 16;

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

  /// Number of consecutive late packets, with this one.
  int late_in_a_row(const RtpPacket& packet) const {
    return packet.sequence_number == next_late_ ? late_in_a_row_ + 1 : 1;
  }

  void change_sender(const RtpPacket& packet) {
    const bool returns =
        previous_ && previous_->ssrc == packet.ssrc && previous_->packets_before(packet) >= 0;
    std::erase(second_senders_, packet.ssrc);
    if (returns) {
      if (second_senders_.size() == max_second_senders)
        second_senders_.erase(second_senders_.begin());
      second_senders_.push_back(position_->ssrc);
    }
    previous_ = position_;
  }

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
  RtpUnpacker(SensorSize sensor, RtpEventFormat format) { change(sensor, format); }

  /// Changes the sensor or format; call flush() first.
  void change(SensorSize sensor, RtpEventFormat format) {
    sensor_ = sensor;
    format_ = format;
    evt3_ = make_evt3_unit_decoder(sensor);
  }

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
  void reset() {
    sender_ = {};
    close_interval();
    is_discontinuous_ = true;
  }

  const RtpStatistics& statistics() const { return statistics_; }

 private:
  /// Appends the events of a packet.
  class Appender {
   public:
    Appender(const RtpPayloadHeader& header, std::vector<Event>& events)
        : events_(events),
          base_(header.base),
          latest_(static_cast<std::uint64_t>((header.start + header.duration) / 1000 -
                                             header.start / 1000)) {}

    /// Appends an event at `t`, relative to the header's base. False if it is earlier than the one
    /// before, or outside the interval.
    bool append(std::uint64_t t, std::uint16_t x, std::uint16_t y_p) {
      t += base_;
      if (t > latest_ || t < earliest_) return false;
      earliest_ = t;
      events_.push_back({static_cast<std::uint32_t>(t), x, y_p});
      return true;
    }

   private:
    std::vector<Event>& events_;
    std::uint64_t base_;
    std::uint64_t latest_;
    std::uint64_t earliest_ = 0;
  };

  /// Appends a packet's events to the current interval's. False, without any change, if
  /// any part of the packet is invalid.
  std::optional<RtpPayloadHeader> decode(const RtpPacket& packet) {
    events_.resize(event_count_);
    const auto header = RtpPayloadHeader::read(packet.payload);
    if (!header || header->format != format_) return std::nullopt;
    const auto body = packet.payload.subspan(RtpPayloadHeader::size);
    const bool is_valid =
        format_ == RtpEventFormat::evt3 ? decode_evt3(*header, body) : decode_xytp(*header, body);
    if (!is_valid || (is_of_interval(packet, *header) && !continues_interval()))
      return std::nullopt;
    if (sender_.is_of_second_sender(packet)) {
      ++statistics_.second_sender_packets;
      return std::nullopt;
    }
    return header;
  }

  bool decode_evt3(const RtpPayloadHeader& header, std::span<const std::uint8_t> words) {
    evt3_->restore({});
    corruption_ = {};
    words_.events.clear();
    words_.triggers.clear();
    Appender appender(header, events_);
    Batch batch(corruption_);
    batch.start = words.data();
    const auto* from = words.data();
    const auto* const to = from + words.size();
    while (from != to) {
      batch.open(words_, static_cast<std::size_t>(to - from));
      from = evt3_->read(from, to, batch);
      for (const auto& event : batch.close())
        if (!appender.append(static_cast<std::uint64_t>(event.t), event.x, event.y_p)) return false;
    }
    return corruption_.places == 0 && corruption_.outside == 0 &&
           events_.size() - event_count_ == header.event_count;
  }

  bool decode_xytp(const RtpPayloadHeader& header, std::span<const std::uint8_t> bytes) {
    Appender appender(header, events_);
    for (std::size_t i = 0; i < bytes.size(); i += sizeof(Event)) {
      const auto event = little_endian<Event>(bytes.data() + i);
      if (event.x >= sensor_.width || event.y() >= sensor_.height ||
          !appender.append(event.t, event.x, event.y_p))
        return false;
    }
    return true;
  }

  /// Whether a packet is the next one of the current interval.
  bool is_of_interval(const RtpPacket& packet, const RtpPayloadHeader& header) const {
    return interval_ && sender_.is_next(packet) && header.start == interval_->start &&
           header.duration == interval_->duration;
  }

  /// Whether the decoded events may follow the current interval's.
  bool continues_interval() const {
    return event_count_ == 0 || events_.size() == event_count_ ||
           (events_[event_count_].t >= events_[event_count_ - 1].t &&
            events_.size() <= max_rtp_interval_events);
  }

  /// Adds the decoded events to the interval.
  void add(const RtpPacket& packet, const RtpPayloadHeader& header) {
    const auto loss = sender_.follow(packet, header);
    is_discontinuous_ |= loss.is_discontinuous;
    if (!interval_) {
      is_discontinuous_ |= header.start < end_;
      interval_ = header;
      arrival_ = packet.arrival;
    }
    event_count_ = events_.size();
    ++statistics_.packets;
    statistics_.bytes += packet.payload.size();
    statistics_.events += header.event_count;
    statistics_.lost_packets += loss.packets;
    statistics_.lost_events += loss.events;
  }

  void close_interval() {
    if (interval_) end_ = interval_->start + interval_->duration;
    interval_.reset();
    events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(event_count_));
    event_count_ = 0;
    is_discontinuous_ = false;
  }

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
