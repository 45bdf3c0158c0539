// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_compression.hpp"
#include "src/formats/aedat/aedat4_table.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/reader.hpp"

namespace eventcamera {

/// Reads AEDAT4: streams of events, frames and triggers. Bytes come in pieces of any size: how they
/// are split changes nothing. A packet is the smallest unit that is read or skipped.
///
/// The id of a trigger is what gave the edge: 0 the camera's input, 1 its generator, 2 a frame, 3
/// an exposure, 4 the zeroing of its clock.
class Aedat4Decoder final : public Reader {
 public:
  Aedat4Decoder();

  void push(std::span<const std::uint8_t> piece) override;
  void finish() override { finished_ = true; }
  std::optional<Item> next() override;

  /// The table of packets is read from it, as soon as the header tells where that is.
  bool open(ByteSource& source) override;

  /// Those of the header, and any that packets named besides.
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return corruption_; }

  /// By the table of packets, where there is one; else before the first packet.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override;
  void restart(const SeekPoint& seek_point) override { resume(seek_point.position); }
  std::optional<Microseconds> last_time() override;
  bool is_empty(std::size_t stream) const override;
  std::string format_name() const override { return "AEDAT 4.0"; }
  std::uint64_t imu_samples() const override { return skipped_.imu_samples; }

  /// What is pushed next lies at `position`, where a packet should begin. The header has to have
  /// been read.
  void resume(std::uint64_t position);

  bool header_read() const { return packets_at_ != 0; }

  Aedat4Compression compression() const { return compression_; }

  /// Where the first packet begins, once the header is read.
  std::uint64_t packets_at() const { return packets_at_; }

  /// Where the table of packets begins, where the header says that there is one.
  std::optional<std::uint64_t> table_at() const { return table_at_; }

  /// Where the header says so.
  std::uint64_t table_field_at() const { return table_field_at_; }

  /// Where something like a table was come upon.
  std::optional<std::uint64_t> table_found_at() const { return table_found_at_; }

  /// What is sound, but not handed over.
  struct Skipped {
    std::uint64_t imu_samples = 0;
    std::uint64_t frames = 0;   ///< of a pixel format that we do not know
    std::uint64_t packets = 0;  ///< of other kinds
  };
  const Skipped& skipped() const { return skipped_; }

 private:
  enum class Place { more, end, packet, table, noise };

  /// A packet's elements that have not been handed over.
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
  Item next_events();
  std::span<const AbsoluteEvent> checked_events(std::size_t count);
  Item next_triggers();

  ByteQueue queue_;
  bool finished_ = false;
  bool scanning_ = false;  ///< for the next place that looks like a packet
  bool listed_ = false;    ///< the header lists the streams
  std::uint64_t packets_at_ = 0;
  std::optional<std::uint64_t> table_at_;
  std::uint64_t table_field_at_ = 0;
  std::optional<std::uint64_t> table_found_at_;
  ByteSource* source_ = nullptr;  ///< once it is opened
  std::vector<Aedat4TableEntry> table_;
  bool table_missing_ = false;  ///< where the header says that there is one
  bool table_reported_ = false;
  Aedat4Compression compression_ = Aedat4Compression::none;
  std::vector<StreamInfo> streams_;
  std::vector<Microseconds> newest_;  ///< the latest event of each stream
  Aedat4Decompressor decompressor_;

  std::size_t packet_ = 0;  ///< bytes of the packet that is being handed over
  Elements elements_;
  std::optional<FrameItem> frame_;
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;

  std::size_t credit_;  ///< work that may still be spent on looking into corrupt packets
  Corruption corruption_;
  Skipped skipped_;
};

}  // namespace eventcamera
