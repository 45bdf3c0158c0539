// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/event_decoder.hpp"
#include "src/formats/seek_points.hpp"
#include "src/formats/unit_decoder.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

/// EventDecoder for formats with a header followed by units of a few bytes.
class UnitStreamDecoder : public EventDecoder {
 public:
  /// For data without a header.
  UnitStreamDecoder(std::unique_ptr<UnitDecoder> decoder, SensorSize size);

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) final;
  void finish(Decoded& out) final;

 protected:
  UnitStreamDecoder() = default;

  /// Consumes part of the header from the front of `bytes` and returns its size; 0 if more bytes
  /// are needed. Calls begin() at the end of the header. `ended`: no more bytes will follow. Throws
  /// UnsupportedFormat.
  virtual std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended);

  void begin(std::unique_ptr<UnitDecoder> decoder, SensorSize size);

  /// Position of the first unit; valid only after begin().
  std::uint64_t units_begin() const { return units_begin_; }

 private:
  void restore(const SeekPoint& seek_point) final;
  void read_headers(bool ended);
  std::size_t read_units(std::span<const std::uint8_t> bytes, Decoded& out);

  std::unique_ptr<UnitDecoder> decoder_;  // null until the header is read
  std::vector<std::uint8_t> rest_;        // incomplete header or unit
  std::uint64_t position_ = 0;            // offset of the next byte to read
  std::uint64_t units_begin_ = 0;
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
  Batch batch_{corruption_};
};

}  // namespace eventcamera
