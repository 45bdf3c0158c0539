// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "src/core/address_layout.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Versions of AEDAT whose records are an address and a time: 1.0 has addresses of 16 bits, of a
/// DVS128.
enum class Aedat2Version : std::uint8_t { one, two };

/// Decodes AEDAT 2.0 of DAVIS cameras, the DVS128 and v2e, and AEDAT 1.0. Skips frames and IMU
/// samples.
///
/// If the header names no camera, the first addresses determine their layout. A sensor size that
/// neither the header nor the user states stays 0x0, and then events are mirrored.
class Aedat2Decoder final : public EventDecoder {
 public:
  /// `assumed` is the sensor size to use if the header states neither that nor the camera.
  explicit Aedat2Decoder(SensorSize assumed = {}, Aedat2Version version = Aedat2Version::two);

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

  /// Position of the first record, once the header is read.
  std::uint64_t data_at() const { return data_at_; }

 private:
  struct Record {
    std::uint32_t address;
    std::int32_t t;
  };

  bool read_header();
  void handle_line(const std::string& line);
  void end_header();
  bool find_camera();
  bool find_layout();
  void find_size();
  void read_records(Decoded& out);
  bool read_odd_record(Decoded& out);
  bool scan();
  bool within_sensor(std::uint32_t address) const;
  bool far(std::int32_t t) const;
  Microseconds unwrapped(std::int32_t t) const;
  void append(const Record& record, Decoded& out);
  Record record_at(const std::uint8_t* bytes) const;

  const SensorSize assumed_;
  const std::size_t address_size_;  ///< in bytes
  const std::size_t record_size_;
  ByteQueue queue_;
  bool finished_ = false;

  AedatHeader header_;
  bool of_v2e_ = false;
  bool header_read_ = false;
  std::uint64_t data_at_ = 0;
  std::optional<AddressLayout> layout_;
  SensorSize limit_;  ///< of rows and columns

  bool scanning_ = false;             ///< searching for the next valid records
  std::int64_t wraps_ = 0;            ///< sum of the wraps so far
  std::optional<std::int32_t> last_;  ///< time of the latest record, as stored
};

}  // namespace eventcamera
