// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat2_layout.hpp"
#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoded.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT 2.0 of DAVIS cameras, the DVS128 and v2e. Skips frames and IMU samples.
///
/// If the header names no camera, the first addresses determine their layout. A sensor size that
/// neither the header nor the user states stays 0x0, and then events are mirrored.
class Aedat2Decoder final : public Decoder {
 public:
  /// `assumed` is the sensor size to use if the header states neither that nor the camera.
  explicit Aedat2Decoder(SensorSize assumed = {}) : assumed_(assumed) {}

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
  void take_line(const std::string& line);
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
  static Record record_at(const std::uint8_t* bytes);

  const SensorSize assumed_;
  ByteQueue queue_;
  bool finished_ = false;

  AedatHeader header_{"#!AER-DAT2.0", "#End Of ASCII Header"};
  bool of_v2e_ = false;
  bool header_read_ = false;
  std::uint64_t data_at_ = 0;
  std::optional<AddressLayout> layout_;
  SensorSize limit_;  ///< of rows and columns

  bool scanning_ = false;             ///< searching for the next valid records
  std::int64_t wraps_ = 0;            ///< sum of the wraps so far
  std::optional<std::int32_t> last_;  ///< time of the latest record, as stored
  Microseconds newest_ = std::numeric_limits<Microseconds>::min();  ///< time of the latest event
};

}  // namespace eventcamera
