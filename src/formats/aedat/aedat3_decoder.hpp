// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Reads AEDAT 3.1: polarity events, and edges on the camera's inputs. Frames, IMU samples and what
/// else there is are left out. The size stays 0x0 where the header names no camera that we know.
class Aedat3Decoder final : public Decoder {
 public:
  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  /// What is left of the packet that is being read.
  struct Packet {
    int type = 0;
    std::uint64_t events = 0;  ///< of 8 bytes, to be read
    std::uint64_t rest = 0;    ///< bytes behind them, to be skipped
    Microseconds overflow = 0;
  };

  bool read_header();
  void take_line(const std::string& line);
  void read_packets(Decoded& out);
  bool read_packet_header();
  bool read_events(Decoded& out);
  bool scan();
  bool begins_packet(const std::uint8_t* bytes) const;
  bool is_odd(const std::uint8_t* event) const;
  void append(const std::uint8_t* event, Decoded& out);

  ByteQueue queue_;
  bool finished_ = false;
  AedatHeader header_{"#!AER-DAT3.1", "#!END-HEADER"};
  bool header_read_ = false;
  bool scanning_ = false;  ///< for the next place that looks like a packet
  Packet packet_;
  Microseconds newest_ = std::numeric_limits<Microseconds>::min();
};

}  // namespace eventcamera
