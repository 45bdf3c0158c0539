// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "src/formats/aedat/aedat_header.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT 3.1: polarity events, and edges on the camera's inputs. Skips frames, IMU samples
/// and all other packets. The size stays 0x0 if the header names no known camera.
class Aedat3Decoder final : public EventDecoder {
 public:
  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  /// Rest of the packet being read.
  struct Packet {
    int type = 0;
    std::uint64_t events = 0;  ///< number of 8-byte events to read
    std::uint64_t rest = 0;    ///< number of bytes to skip after them
    Microseconds overflow = 0;
    bool is_intact = false;  ///< another packet, or the end of the file, is known to follow it
  };

  bool read_header();
  void handle_line(const std::string& line);
  void read_packets(Decoded& out);
  bool read_packet_header();
  bool read_events(Decoded& out);
  bool read_odd_event();
  std::optional<bool> is_packet_intact();
  bool scan();
  bool begins_packet(const std::uint8_t* bytes) const;
  bool is_odd(const std::uint8_t* event) const;
  void append(const std::uint8_t* event, Decoded& out);

  ByteQueue queue_;
  bool finished_ = false;
  AedatHeader header_{"#!AER-DAT3.1", "#!END-HEADER"};
  bool header_read_ = false;
  bool scanning_ = false;  ///< searching for the next packet
  Packet packet_;
};

}  // namespace eventcamera
