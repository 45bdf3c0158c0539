// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "src/formats/byte_queue.hpp"
#include "src/formats/ros/bag_file.hpp"
#include "src/formats/ros/chunk_index.hpp"

namespace eventcamera {

/// A bag that is a sequence of records, some of which are chunks: compressed sequences of records.
/// A record is the smallest unit that is read or skipped. After corruption, searches for the next
/// chunk.
class ChunkedBagFile : public BagFile {
 public:
  void push(std::span<const std::uint8_t> piece) final { queue_.push(piece); }
  void finish() final { finished_ = true; }
  bool open(ByteSource& source) final {
    read_index(source);
    return false;
  }
  std::optional<BagMessage> next() final;
  std::optional<SeekPoint> seek_point_before(Microseconds logged) const final;
  void restart(const SeekPoint& seek_point) final;
  std::optional<SeekPoint> first_of(std::size_t topic) const final {
    return index_.first_of(topic);
  }
  std::optional<Microseconds> last_logged() const final { return index_.last(); }

 protected:
  /// Size limit of records that are read, and of chunks decompressed.
  static constexpr std::size_t max_record = std::size_t{1} << 27;
  /// Size limit of an index.
  static constexpr std::size_t max_index = std::size_t{1} << 27;
  /// Limit of topics.
  static constexpr std::size_t max_topics = 4096;

  /// First bytes of a record, parsed.
  struct Head {
    enum class Kind : std::uint8_t { none, skipped, read, chunk, end };
    Kind kind = Kind::none;  ///< none: this is not a record
    std::uint64_t size = 0;  ///< of the whole record
  };

  using Bytes = std::span<const std::uint8_t>;

  /// `magic`: first bytes of the file. `scanned_bytes`: as many as begins_record() needs.
  ChunkedBagFile(AddTopic add_topic, std::string_view magic, std::size_t scanned_bytes)
      : BagFile(std::move(add_topic)), magic_(magic), scanned_bytes_(scanned_bytes) {}

  /// Reads topics and the index of chunks. A file without them, or a truncated one, is read anyway.
  virtual void read_index(ByteSource& source) = 0;

  /// Reads the head of the record that `bytes` begin with; nothing if it takes more bytes.
  virtual std::optional<Head> head_of(Bytes bytes) const = 0;

  /// True if a chunk, or a message of a known topic, surely begins here. `bytes` are at least as
  /// many as scanned_bytes.
  virtual bool begins_record(Bytes bytes) const = 0;

  /// Reads a record. Returns the message that it is, if it is one of a topic that is read.
  virtual std::optional<BagMessage> read_record(Bytes record, std::uint64_t position) = 0;

  /// Returns the records of a chunk; nothing if they are corrupt, which is noted. `is_cut`: the
  /// file ends within the chunk.
  virtual std::optional<Bytes> records_of(Bytes chunk, std::uint64_t position, bool is_cut) = 0;

  ChunkIndex index_;

 private:
  bool read_magic();
  bool next_record();
  bool skip_bytes();
  bool scan();
  bool find_record_in_chunk();
  std::optional<BagMessage> next_in_chunk();
  void corrupt(const char* what);

  std::string_view magic_;
  std::size_t scanned_bytes_;
  ByteQueue queue_;
  bool finished_ = false;
  bool magic_read_ = false;
  bool ended_ = false;      ///< the end of the data was read; an index may follow
  bool scanning_ = false;   ///< searching for the next chunk
  std::uint64_t skip_ = 0;  ///< bytes still to skip
  std::size_t record_ = 0;  ///< size of the record being read, to be consumed when it has been
  Head::Kind kind_ = Head::Kind::none;  ///< of that record
  std::optional<Bytes> chunk_;          ///< rest of the records of the chunk being read
};

}  // namespace eventcamera
