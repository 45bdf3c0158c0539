// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/wire/datagram_settings.hpp"

namespace eventcamera {

/// Maximum time between the first and the last event of a datagram: 71 minutes, so that 32-bit
/// times are unambiguous even after a short pause.
inline constexpr Microseconds max_datagram_span = Microseconds{71} * 60 * 1'000'000;

/// Outcome of receiving a datagram.
struct Reception {
  const char* fault = nullptr;  ///< why it was rejected, for users; null if it was not
  bool late = false;            ///< dropped, because later events had already arrived
  bool restarted = false;       ///< times or sequence numbers start over: a new stream
  std::uint64_t lost = 0;       ///< datagrams that were lost before this one
};

/// Unpacks datagrams of a format, each by itself; only wraps of 32-bit times and sequence numbers
/// are tracked across datagrams. A datagram that is malformed, or that has an event outside the
/// sensor, is rejected as a whole and changes no state.
class DatagramUnpacker {
 public:
  virtual ~DatagramUnpacker() = default;
  DatagramUnpacker(const DatagramUnpacker&) = delete;
  DatagramUnpacker& operator=(const DatagramUnpacker&) = delete;

  /// Replaces `events` by the datagram's, sorted by time and not earlier than all before, or
  /// by none. `arrival` is the receiver's time, if known; it is the time of events without a
  /// timestamp, and reveals wraps during pauses of hours.
  virtual Reception unpack(std::span<const std::uint8_t> bytes, std::optional<Microseconds> arrival,
                           std::vector<AbsoluteEvent>& events) = 0;

 protected:
  DatagramUnpacker() = default;
};

/// Throws std::invalid_argument if the format does not support the sensor.
std::unique_ptr<DatagramUnpacker> make_datagram_unpacker(const DatagramSettings& settings);

}  // namespace eventcamera
