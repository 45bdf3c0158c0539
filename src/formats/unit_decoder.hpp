// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// A decoder of a format that is a header and then units of a few bytes each.
class UnitDecoder : public Decoder {
 public:
  /// Without a header.
  UnitDecoder(std::unique_ptr<UnitReader> reader, SensorSize size);

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) final;
  void finish(Decoded& out) final;
  void restart(const SeekPoint& seek_point) final;

 protected:
  UnitDecoder() = default;

  /// Takes some of the header from the front of `bytes`, and returns how much; 0 where that takes
  /// more bytes. Where the header ends, calls begin(). `ended`: no more will come. Throws
  /// UnsupportedFormat.
  virtual std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended);

  void begin(std::unique_ptr<UnitReader> reader, SensorSize size);

 private:
  void read_headers(bool ended);
  std::size_t read_units(std::span<const std::uint8_t> bytes, Decoded& out);
  void deliver(Decoded& out);

  std::unique_ptr<UnitReader> reader_;  // none before the header is read
  std::vector<std::uint8_t> rest_;      // of what was given, where it is not yet whole
  std::uint64_t position_ = 0;          // of what is read next
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
  Batch batch_{corruption_};
};

}  // namespace eventcamera
