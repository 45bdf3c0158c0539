// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include "src/core/event.hpp"
#include "src/wire/datagram_settings.hpp"

namespace eventcamera {

/// A packed datagram.
struct Datagram {
  std::span<const std::uint8_t> bytes;
  std::size_t events;
  Microseconds first;  ///< time of the first event
  Microseconds last;   ///< time of the last event
};

/// Packs events into datagrams of a format. A datagram is complete when it is full, when the next
/// event is more than `max_span` later than its first, or earlier than its last.
class DatagramPacker {
 public:
  /// Receives a datagram, whose bytes are valid during the call.
  using Send = std::function<void(const Datagram&)>;

  virtual ~DatagramPacker() = default;
  DatagramPacker(const DatagramPacker&) = delete;
  DatagramPacker& operator=(const DatagramPacker&) = delete;

  /// Adds events, which must be within the sensor, and sends each datagram that they complete.
  virtual void pack(std::span<const AbsoluteEvent> events, const Send& send) = 0;

  /// Sends the incomplete datagram, if any.
  virtual void flush(const Send& send) = 0;

  /// Drops the incomplete datagram, if any.
  virtual void drop() noexcept = 0;

  /// Time of the first event of the incomplete datagram, if any.
  virtual std::optional<Microseconds> waiting_since() const = 0;

  /// Maximum time between the first and the last event of a datagram.
  void set_max_span(Microseconds max_span) { max_span_ = max_span; }

 protected:
  DatagramPacker() = default;

  Microseconds max_span_ = std::numeric_limits<Microseconds>::max();
};

/// Throws std::invalid_argument if the format does not support the sensor.
std::unique_ptr<DatagramPacker> make_datagram_packer(const DatagramSettings& settings);

}  // namespace eventcamera
