// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"
#include "src/wire/rtp_payload.hpp"

namespace eventcamera {

/// Events to be sent: one interval, or several consecutive intervals joined.
class PendingInterval {
 public:
  explicit PendingInterval(SensorSize sensor) : sensor_(sensor) {}

  bool empty() const { return !is_open_; }
  Nanoseconds start() const { return start_; }
  Nanoseconds end() const { return end_; }
  /// Times are relative to `start`, rounded down to microseconds.
  std::span<const Event> events() const { return events_; }

  void clear() {
    is_open_ = false;
    events_.clear();
  }

  /// Adds an interval, which must start at the end of the pending one and not after max_rtp_start,
  /// with events relative to its start. Calls flush(), which must clear, whenever there are
  /// max_rtp_interval_events. Returns the events that cannot be sent.
  template <class Flush>
  InvalidEvents add(Nanoseconds start, Nanoseconds end, std::span<const Event> events,
                    const Flush& flush) {
    if (!is_open_) start_ = start;
    is_open_ = true;
    end_ = std::clamp(end, start, start_ + max_interval);
    InvalidEvents rejected;
    // Offset of event times, and their maximum.
    auto shift = microseconds(start) - microseconds(start_);
    const auto latest = microseconds(end_) - microseconds(start);
    std::uint32_t earliest = 0;
    for (const auto& event : events) {
      const bool is_outside = event.x >= sensor_.width || event.y() >= sensor_.height;
      if (is_outside || event.t < earliest || event.t > latest) {
        ++(is_outside ? rejected.outside : rejected.unsorted);
        continue;
      }
      if (events_.size() == max_rtp_interval_events) {
        split(flush);
        shift = microseconds(start) - microseconds(start_);
      }
      earliest = event.t;
      events_.push_back({static_cast<std::uint32_t>(event.t + shift), event.x, event.y_p});
    }
    return rejected;
  }

 private:
  static constexpr Microseconds microseconds(Nanoseconds time) { return time / 1000; }

  /// Flushes the events so far, and continues with the rest of the interval.
  template <class Flush>
  void split(const Flush& flush) {
    const auto end = end_;
    end_ = std::max(start_, (microseconds(start_) + events_.back().t) * 1000);
    const auto next = end_;
    flush();
    is_open_ = true;
    start_ = next;
    end_ = end;
  }

  SensorSize sensor_;
  bool is_open_ = false;
  Nanoseconds start_ = 0;
  Nanoseconds end_ = 0;
  std::vector<Event> events_;
};

/// Packs events into RTP payloads, each of which can be decoded by itself.
class RtpPacker {
 public:
  static constexpr std::size_t min_size = RtpPayloadHeader::size + 16;

  /// `first_event` is the number of the first event. Throws std::invalid_argument if the format
  /// does not support the sensor.
  RtpPacker(SensorSize sensor, RtpEventFormat format, std::uint32_t first_event = 0)
      : width_(sensor.width), format_(format), next_event_(first_event) {
    if (format == RtpEventFormat::evt3 && std::max(sensor.width, sensor.height) > max_evt_side)
      throw std::invalid_argument("EVT3 words support sensors of 1x1 to 2048x2048 pixels");
  }

  /// Calls send(payload, is_last) for each packet of an interval, at least one. Events must be
  /// sorted and within the sensor, at most max_rtp_interval_events, and their times relative to
  /// `start`, rounded down to microseconds. No payload is longer than `max_size`. A payload is
  /// valid during the call only.
  template <class Send>
  void pack(Nanoseconds start, Nanoseconds duration, std::span<const Event> events,
            std::size_t max_size, const Send& send) {
    do {
      events = events.subspan(pack_one(start, duration, events, max_size));
      send(std::span<const std::uint8_t>(payload_), events.empty());
    } while (!events.empty());
  }

  /// Number of the next event, modulo 2^32.
  std::uint32_t next_event() const { return next_event_; }

 private:
  /// The header has 16 bits for the number of events.
  static constexpr std::size_t max_events = 0xffff;

  /// Maximum number of TIME_HIGH words for a pause. A longer pause ends the packet, because another
  /// header takes no more bytes.
  static constexpr std::uint64_t max_pause_words = 32;

  /// The words of a packet hold 24 bits of a time.
  static constexpr std::uint64_t max_time = 0xffffff;

  /// Packs one payload, and returns the number of its events.
  std::size_t pack_one(Nanoseconds start, Nanoseconds duration, std::span<const Event> events,
                       std::size_t max_size) {
    if (max_size < min_size) throw std::invalid_argument("no space for events in a packet");
    payload_.assign(RtpPayloadHeader::size, 0);
    const bool is_evt3 = format_ == RtpEventFormat::evt3;
    const auto count = is_evt3 ? append_evt3(events, max_size) : append_xytp(events, max_size);
    const RtpPayloadHeader header{
        .format = format_,
        .event_count = static_cast<std::uint16_t>(count),
        .first_event = next_event_,
        .start = start,
        .duration = duration,
        .base = is_evt3 && !events.empty() ? events.front().t : 0,
    };
    header.write(payload_.data());
    next_event_ += static_cast<std::uint32_t>(count);
    return count;
  }

  std::size_t append_evt3(std::span<const Event> events, std::size_t max_size) {
    Evt3Words state(width_);
    WordWriter<std::uint16_t> words(payload_);
    const auto max_words =
        std::min(events.size(), max_events) * (max_pause_words + Evt3Words::max_words);
    words.reserve(std::min((max_size - payload_.size()) / sizeof(std::uint16_t), max_words));
    std::size_t count = 0;
    while (count < events.size() && count + Evt3Words::max_events <= max_events) {
      const std::uint64_t time = events[count].t - events.front().t;
      const auto steps = state.steps_to(time);
      const auto needed = (steps + Evt3Words::max_words) * sizeof(std::uint16_t);
      if (steps > max_pause_words || time > max_time || words.size() + needed > max_size) break;
      count += state.write(events.subspan(count), time, words);
    }
    return count;
  }

  std::size_t append_xytp(std::span<const Event> events, std::size_t max_size) {
    const auto count =
        std::min({events.size(), (max_size - payload_.size()) / sizeof(Event), max_events});
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(events.data());
    payload_.insert(payload_.end(), bytes, bytes + count * sizeof(Event));
    return count;
  }

  int width_;
  RtpEventFormat format_;
  std::uint32_t next_event_;
  std::vector<std::uint8_t> payload_;
};

}  // namespace eventcamera
