// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/seek_points.hpp"

namespace eventcamera {

/// Bytes at the end of a file that are read to find its last event; covers the disorder of events.
constexpr std::size_t tail_size = std::size_t{1} << 16;

/// Decodes a format with a single stream, of events and triggers. Bytes are passed in pieces of any
/// size; the split does not affect the result. Memory is bounded by the size of the pieces and the
/// format's largest unit, never by a length stated in the bytes.
class EventDecoder : public Decoder {
 public:
  /// Appends all events and triggers completed by `bytes`. Throws UnsupportedFormat.
  virtual void decode(std::span<const std::uint8_t> bytes, Decoded& out) = 0;

  /// Declares the end of the bytes: appends what is complete and reports a partial rest as
  /// corruption. Throws UnsupportedFormat if the header is incomplete.
  virtual void finish(Decoded& out) = 0;

  /// Appends the last events of the file, if they can be decoded without reading all events before.
  /// Must be called after the header was read.
  virtual void decode_tail(ByteSource& /*source*/, Decoded& /*out*/) const {}

  /// Sensor size, once the header is read or if known from elsewhere; 0x0 before.
  SensorSize size() const { return stream_.size; }

  void push(std::span<const std::uint8_t> piece) final { pushed_ = piece; }
  void drain() final { is_draining_ = true; }
  bool open(ByteSource& source) final {
    source_ = &source;
    return false;
  }
  std::optional<Item> next() final;
  const std::vector<StreamInfo>& streams() const final { return streams_; }
  const Corruption& corruption() const final { return corruption_; }

  /// Because times wrap in many formats, seek points exist only for the part that was read; a seek
  /// past it restarts at the last one. None for formats that can only be read from the start.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const final {
    return seek_points_.before(t);
  }
  void restart(const SeekPoint& seek_point) final;
  std::optional<Microseconds> last_time() final;

 protected:
  EventDecoder() = default;

  /// Restores the state at a seek point. Corruption that is read again counts again.
  virtual void restore(const SeekPoint& /*seek_point*/) {}

 private:
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};

 protected:
  StreamInfo& stream_ = streams_.front();
  Corruption corruption_;
  SeekPoints seek_points_;

 private:
  ByteSource* source_ = nullptr;           ///< null in push mode, and once the last time is known
  std::optional<Microseconds> last_time_;  ///< if decode_tail() finds it
  std::span<const std::uint8_t> pushed_;   ///< not decoded yet
  bool is_draining_ = false;               ///< finish() is due
  Decoded decoded_;
  bool events_due_ = false;  ///< events in decoded_ are to be returned
  bool triggers_due_ = false;
};

}  // namespace eventcamera
