// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT 2.0 of DAVIS cameras and the DVS128. Skips frames and IMU samples.
class Aedat2Decoder final : public Decoder {
 public:
  /// `assumed` is the sensor size to use if the header names no camera: 128x128 means a DVS128, any
  /// other size a DAVIS. If it is 0x0, files of v2e are read as DAVIS346, which v2e writes, and
  /// others as DVS128, whose oldest files do not name the camera.
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
  void read_records(Decoded& out);
  bool read_odd_record(Decoded& out);
  bool scan();
  bool within_sensor(std::uint32_t address) const;
  bool far(std::int32_t t) const;
  Microseconds unwrapped(std::int32_t t) const;
  void append(const Record& record, Decoded& out);
  static Record record_at(const std::uint8_t* bytes);

  SensorSize assumed_;
  ByteQueue queue_;
  bool finished_ = false;

  AedatHeader header_{"#!AER-DAT2.0", "#End Of ASCII Header"};
  bool of_v2e_ = false;
  bool header_read_ = false;
  std::uint64_t data_at_ = 0;
  bool davis_ = false;

  bool scanning_ = false;             ///< searching for the next valid records
  std::int64_t wraps_ = 0;            ///< sum of the wraps so far
  std::optional<std::int32_t> last_;  ///< time of the latest record, as stored
  Microseconds newest_ = std::numeric_limits<Microseconds>::min();  ///< time of the latest event
};

}  // namespace eventcamera
