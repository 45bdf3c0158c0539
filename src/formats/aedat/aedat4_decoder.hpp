// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_compression.hpp"
#include "src/formats/aedat/aedat4_table.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/recording_decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT4: streams of events, frames, triggers and IMU samples. Bytes are passed in pieces
/// of any size; the split does not affect the result. A packet is the smallest unit that is read or
/// skipped.
///
/// The ID of a trigger is the source of the edge: 0 the camera's input, 1 its generator, 2 a frame,
/// 3 an exposure, 4 a reset of its clock, 5 a pulse at its input, 6 any other.
class Aedat4Decoder final : public RecordingDecoder {
 public:
  Aedat4Decoder();

  void push(std::span<const std::uint8_t> piece) override;
  void finish() override { finished_ = true; }
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
  bool is_empty(std::size_t stream) const override;
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

  /// Elements of a packet not returned yet.
  struct Elements {
    StreamKind kind = StreamKind::other;
    const std::uint8_t* data = nullptr;
    std::size_t count = 0;
    std::size_t stream = 0;
  };

  bool read_header();
  bool scan();
  bool read_packet();
  Place place_at(std::size_t offset);
  bool begins_packet(std::span<const std::uint8_t> bytes) const;
  bool has_sound_events(std::span<const std::uint8_t> content, int id) const;
  const char* read_content(std::span<const std::uint8_t> content, int id);
  const char* read_frame(std::span<const std::uint8_t> content);
  std::optional<std::size_t> stream_of(int id) const;
  std::size_t add_stream(int id, StreamKind kind);
  void read_table();
  void note_missing_table();
  void skip_corrupt(std::size_t packet, std::size_t sound, std::size_t work, bool sound_after);
  Item next_elements();
  Item next_events();
  std::span<const AbsoluteEvent> checked_events(std::size_t count);
  template <class Table, class Element>
  void read_tables(Element (*element_of)(const Table&), const char* corruption,
                   std::vector<Element>& out);

  ByteQueue queue_;
  bool finished_ = false;
  bool scanning_ = false;  ///< searching for the next packet
  bool listed_ = false;    ///< the header lists all streams
  std::uint64_t packets_at_ = 0;
  std::optional<std::uint64_t> table_at_;
  std::uint64_t table_field_at_ = 0;             ///< of that position in the header
  std::optional<std::uint64_t> table_found_at_;  ///< while reading
  ByteSource* source_ = nullptr;                 ///< set by open()
  std::vector<Aedat4TableEntry> table_;
  bool table_missing_ = false;  ///< although the header states one
  bool table_reported_ = false;
  Aedat4Compression compression_ = Aedat4Compression::none;
  std::vector<StreamInfo> streams_;
  FrameDecompressor decompressor_;

  std::size_t packet_ = 0;  ///< size of the packet being returned
  Elements elements_;
  std::optional<FrameItem> frame_;
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;
  std::vector<ImuSample> imu_samples_;

  std::size_t credit_;  ///< remaining work for searching corrupt packets
  Corruption corruption_;
};

}  // namespace eventcamera
