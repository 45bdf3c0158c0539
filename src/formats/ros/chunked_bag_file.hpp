// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "src/formats/byte_queue.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/ros/bag_file.hpp"

namespace eventcamera {

/// Positions and recording times of a bag's chunks, from the index of the file or, without one,
/// from the part that was read.
class ChunkIndex {
 public:
  struct Chunk {
    std::uint64_t position;  ///< in the file, bytes
    Microseconds last;       ///< time of its latest message
  };

  /// Sets the index of a file, in any order. `start` is the position of the first record.
  void set(std::vector<Chunk> chunks, std::uint64_t start) {
    std::ranges::sort(chunks, {}, &Chunk::position);
    auto latest = before_all;
    for (const auto& chunk : chunks) {
      // Chunks may overlap in time.
      indexed_.push_back({latest, chunk.position < start ? start : chunk.position});
      latest = std::max(latest, chunk.last);
    }
    if (!indexed_.empty()) {
      indexed_.front().position = start;
      last_ = latest;
    }
  }

  /// Adds a chunk with messages of a topic, from the index of a file.
  void set_topic(std::size_t topic, std::uint64_t position) {
    auto& first = first_.try_emplace(topic, SeekPoint{before_all, position}).first->second;
    first.position = std::min(first.position, position);
  }

  /// Records the position of a chunk or a message, if no index was set.
  void record_position(std::uint64_t position) {
    if (indexed_.empty() && read_.due(position)) read_.note({latest_, position});
  }

  /// Records the time of a message that was read.
  void read(Microseconds logged) { latest_ = std::max(latest_, logged); }

  /// Returns where to restart for all messages from `logged` on.
  std::optional<SeekPoint> before(Microseconds logged) const {
    if (indexed_.empty()) return read_.before(logged);
    const auto later =
        std::partition_point(indexed_.begin() + 1, indexed_.end(),
                             [logged](const SeekPoint& chunk) { return chunk.t < logged; });
    return *(later - 1);
  }

  /// Returns where to restart for the first message of a topic, if the index states it.
  std::optional<SeekPoint> first_of(std::size_t topic) const {
    const auto first = first_.find(topic);
    return first == first_.end() ? std::nullopt : std::optional(first->second);
  }

  /// Continues at a seek point.
  void restart(const SeekPoint& seek_point) { latest_ = seek_point.t; }

  /// Time of the latest message of the file, if there is an index.
  std::optional<Microseconds> last() const { return last_; }

 private:
  static constexpr auto before_all = std::numeric_limits<Microseconds>::min();

  std::vector<SeekPoint> indexed_;          ///< the chunks of the index; t: the latest before them
  std::map<std::size_t, SeekPoint> first_;  ///< chunks of the index, by topic
  std::optional<Microseconds> last_;
  SeekPoints read_;  ///< if there is no index
  Microseconds latest_ = before_all;
};

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

  /// `magic`: first bytes of the file. `scanned_bytes`: needed by begins_record().
  ChunkedBagFile(AddTopic add_topic, std::string_view magic, std::size_t scanned_bytes)
      : BagFile(std::move(add_topic)), magic_(magic), scanned_bytes_(scanned_bytes) {}

  /// Reads topics and the index of chunks. Files without them, and truncated ones, are read anyway.
  virtual void read_index(ByteSource& source) = 0;

  /// Parses the head of the record at the front of `bytes`; nothing if more bytes are needed.
  virtual std::optional<Head> head_of(Bytes bytes) const = 0;

  /// True if a chunk, or a message of a known topic, certainly begins here. There are at least
  /// scanned_bytes `bytes`.
  virtual bool begins_record(Bytes bytes) const = 0;

  /// Reads a record. Returns its message, if it is one of a topic that is read.
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
