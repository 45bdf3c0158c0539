// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_elements.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT4: streams of events, frames, triggers and IMU samples. Bytes are passed in pieces
/// of any size; the split does not affect the result. A packet is the smallest unit that is read or
/// skipped.
///
/// The ID of a trigger is the source of the edge: 0 the camera's input, 1 its generator, 2 a frame,
/// 3 an exposure, 4 a reset of its clock, 5 a pulse at its input, 6 any other.
class Aedat4Decoder final : public Decoder {
 public:
  Aedat4Decoder();

  void push(std::span<const std::uint8_t> piece) override;
  void drain() override { finished_ = true; }
  std::optional<Item> next() override;

  /// Gives access to the packet table, which is read once the header has been.
  bool open(ByteSource& source) override;

  /// Streams listed in the header, and any others found in packets.
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return corruption_; }

  /// Uses the packet table if there is one; otherwise the position of the first packet.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override;
  void restart(const SeekPoint& seek_point) override { resume(seek_point.position); }
  std::optional<Microseconds> last_time() override;
  std::optional<std::uint64_t> end_of(std::size_t stream, Microseconds t) const override;
  std::uint64_t position() const override { return queue_.position(); }
  std::string format_name() const override { return "AEDAT 4.0"; }

  /// Continues at `position`, the start of a packet. The header must have been read.
  void resume(std::uint64_t position);

  bool header_read() const { return packets_at_ != 0; }

  Aedat4Compression compression() const { return compression_; }

  /// Position of the first packet, once the header is read.
  std::uint64_t packets_at() const { return packets_at_; }

  /// Position of the packet table, if the header states one.
  std::optional<std::uint64_t> table_at() const { return table_at_; }

 private:
  enum class Place { more, end, packet, table, noise };

  /// Payload of a packet.
  struct Payload {
    std::span<const std::uint8_t> content;  ///< decompressed: a FlatBuffer
    std::size_t used = 0;  ///< bytes of the payload that hold it; 0 if it does not decompress
  };

  /// Extent of a stream according to the packet table, ignoring impossible times.
  struct Extent {
    std::uint64_t end = 0;  ///< past the start of its last packet
    Microseconds latest_start = std::numeric_limits<Microseconds>::min();  ///< of its packets
    std::optional<Microseconds> last = {};  ///< time of its last element
  };

  bool read_header();
  void handle_header(std::span<const std::uint8_t> content);
  bool find_packet();
  bool read_packet();
  Place place_at(std::size_t offset);
  bool begins_packet(std::span<const std::uint8_t> bytes) const;
  bool may_have_stream(int id) const;
  bool is_compressed() const { return compression_ != Aedat4Compression::none; }
  Payload unpacked(std::span<const std::uint8_t> payload);
  const char* read_content(const Payload& payload, int id, Place after);
  std::optional<std::size_t> stream_of(int id) const;
  void read_table();
  void note_missing_table();
  void skip_corrupt(const Payload& payload, std::size_t size, Place after);

  ByteQueue queue_;
  Corruption corruption_;
  bool finished_ = false;
  bool scanning_ = false;  ///< searching for the next packet
  bool listed_ = false;    ///< the header lists all streams
  std::uint64_t packets_at_ = 0;
  std::optional<std::uint64_t> table_at_;
  std::uint64_t table_field_at_ = 0;             ///< of that position in the header
  std::optional<std::uint64_t> table_found_at_;  ///< while reading
  ByteSource* source_ = nullptr;                 ///< set by open()
  std::vector<Aedat4TableEntry> table_;
  std::map<int, Extent> extents_;  ///< by stream ID
  bool table_missing_ = false;     ///< although the header states one
  bool table_reported_ = false;
  Aedat4Compression compression_ = Aedat4Compression::none;
  std::vector<StreamInfo> streams_;
  FrameDecompressor decompressor_;

  std::size_t packet_ = 0;  ///< size of the packet being returned
  std::size_t stream_ = 0;  ///< its stream
  Aedat4Elements elements_{corruption_};

  std::size_t credit_;  ///< remaining work for searching corrupt packets
};

}  // namespace eventcamera
