// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Formats of UDP datagrams of other tools.
enum class DatagramFormat : std::uint8_t {
  spif,             ///< SpiNNaker, AEStream, EventCV; no timestamps
  spif_timestamps,  ///< the same, with timestamps
  t64_x16_y16_on8,  ///< faery
  t32_x16_y15_on1,  ///< faery
  es,               ///< Event Stream
  jaer,             ///< jAER's AER-UDP
};

/// Settings that sender and receiver must share; they are not part of the datagrams.
struct DatagramSettings {
  DatagramFormat format = DatagramFormat::spif;
  int width = 0;                                 ///< of the sensor, in pixels
  int height = 0;                                ///< of the sensor, in pixels
  std::endian byte_order = std::endian::little;  ///< of SPIF; the other formats define theirs
  bool has_sequence_number = true;               ///< in datagrams of jAER
};

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

  virtual void flush(const Send& send) = 0;

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
