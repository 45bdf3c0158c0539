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

/// Reads AEDAT 2.0 of DAVIS cameras and of the DVS128. Frames and IMU samples are left out.
class Aedat2Decoder final : public Decoder {
 public:
  /// `assumed` is the sensor's size where the header names no camera: 128x128 is a DVS128, another
  /// a DAVIS of that size. Where it is 0x0, too, v2e's files are of a DAVIS346, which is what it
  /// writes, and others of a DVS128, whose files are older than the naming of cameras.
  explicit Aedat2Decoder(SensorSize assumed = {}) : assumed_(assumed) {}

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

  /// Where the first record lies, once the header has been read.
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

  bool scanning_ = false;             ///< for the next place where records look sound
  std::int64_t wraps_ = 0;            ///< what the wraps so far add to a time
  std::optional<std::int32_t> last_;  ///< the latest record's time in the file
  Microseconds newest_ = std::numeric_limits<Microseconds>::min();  ///< the latest event
};

}  // namespace eventcamera
