// SPDX-License-Identifier: LGPL-2.1-or-later
#include <bzlib.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "src/formats/byte_cursor.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/ros/chunked_bag_file.hpp"

namespace eventcamera {

namespace {

/// Value of the field "op" of a record's header.
enum class Op : std::uint8_t {
  message = 0x02,
  bag = 0x03,
  index = 0x04,
  chunk = 0x05,
  chunk_info = 0x06,
  connection = 0x07,
};

/// Limit of a record's header, bytes.
constexpr std::uint32_t max_header = 1 << 16;

/// Bytes needed to recognise a chunk, whose header has 45.
constexpr std::size_t chunk_head = 64;

/// The fields of a header: each is its size, 32 bits, and "name=value".
class HeaderFields {
 public:
  explicit HeaderFields(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  /// Value of a field; empty if there is none.
  std::string_view value(std::string_view name) const {
    ByteCursor fields(bytes_);
    while (!fields.rest().empty()) {
      const auto field = fields.text();
      if (fields.failed()) break;
      if (field.size() > name.size() && field.starts_with(name) && field[name.size()] == '=')
        return field.substr(name.size() + 1);
    }
    return {};
  }

  /// Value of a field of binary numbers; zeros if there is none.
  template <class Number>
  std::optional<Number> number(std::string_view name) const {
    const auto text = value(name);
    if (text.size() != sizeof(Number)) return std::nullopt;
    return little_endian<Number>(reinterpret_cast<const std::uint8_t*>(text.data()));
  }

  Op op() const { return static_cast<Op>(number<std::uint8_t>("op").value_or(0)); }

  /// A time: seconds and nanoseconds of 32 bits each.
  std::optional<Microseconds> time(std::string_view name) const {
    const auto both = number<std::uint64_t>(name);
    if (!both) return std::nullopt;
    return static_cast<Microseconds>(*both & 0xffffffff) * 1'000'000 +
           static_cast<Microseconds>(*both >> 32) / 1000;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// A record: header and data, each after its size.
struct Record {
  HeaderFields header;
  std::span<const std::uint8_t> data;
  bool is_whole;

  explicit Record(std::span<const std::uint8_t> bytes) : Record(ByteCursor(bytes)) {}

 private:
  explicit Record(ByteCursor fields)
      : header(fields.sized_bytes<std::uint32_t>()),
        data(fields.sized_bytes<std::uint32_t>()),
        is_whole(!fields.failed()) {}
};

bool is_compression(std::string_view name) {
  return name == "none" || name == "bz2" || name == "lz4";
}

class RosbagFile final : public ChunkedBagFile {
 public:
  explicit RosbagFile(AddTopic add_topic)
      : ChunkedBagFile(std::move(add_topic), rosbag_magic, chunk_head) {}

 private:
  void read_index(ByteSource& source) override {
    constexpr std::size_t first_record = 4096;
    std::vector<std::uint8_t> start(rosbag_magic.size() + first_record);
    const auto count = source.read(0, start);
    if (!count || *count != start.size()) return;
    ByteCursor fields(Bytes(start).subspan(rosbag_magic.size()));
    const HeaderFields bag(fields.sized_bytes<std::uint32_t>());
    const auto index_at = bag.number<std::uint64_t>("index_pos").value_or(0);
    const auto size = source.size();
    // It is 0 until the bag is closed.
    if (bag.op() != Op::bag || index_at < rosbag_magic.size() || index_at >= size ||
        size - index_at > max_index)
      return;
    std::vector<std::uint8_t> bytes(size - index_at);
    if (source.read(index_at, bytes) != bytes.size()) return;

    std::vector<ChunkIndex::Chunk> chunks;
    for (Bytes rest = bytes; !rest.empty();) {
      const auto head = head_of(rest);
      if (!head || head->kind == Head::Kind::none || head->size > rest.size()) break;
      const auto record = rest.first(static_cast<std::size_t>(head->size));
      rest = rest.subspan(record.size());
      const Record whole(record);
      if (whole.header.op() == Op::connection) read_record(record, 0);
      const auto position = whole.header.number<std::uint64_t>("chunk_pos");
      const auto last = whole.header.time("end_time");
      if (whole.header.op() != Op::chunk_info || !position || !last) continue;
      chunks.push_back({*position, *last});
      ByteCursor counts(whole.data);
      while (!counts.failed() && !counts.rest().empty()) {
        const auto known = connections_.find(counts.number<std::uint32_t>());
        counts.number<std::uint32_t>();  // of its messages
        if (known != connections_.end() && known->second)
          index_.set_topic(*known->second, *position);
      }
    }
    index_.set(std::move(chunks), rosbag_magic.size());
  }

  std::optional<Head> head_of(Bytes bytes) const override {
    ByteCursor fields(bytes);
    const auto header_size = fields.number<std::uint32_t>();
    if (header_size > max_header) return Head{};
    const HeaderFields header(fields.bytes(header_size));
    const std::uint64_t data_size = fields.number<std::uint32_t>();
    if (fields.failed()) return std::nullopt;
    const auto size = fields.position() + data_size;
    switch (header.op()) {
      case Op::chunk:
        return Head{
            is_compression(header.value("compression")) ? Head::Kind::chunk : Head::Kind::none,
            size};
      case Op::connection:
      case Op::message:
        return Head{Head::Kind::read, size};
      case Op::bag:
      case Op::index:
      case Op::chunk_info:
        return Head{Head::Kind::skipped, size};
    }
    return Head{};
  }

  bool begins_record(Bytes bytes) const override {
    const auto header_size = little_endian<std::uint32_t>(bytes.data());
    if (header_size > chunk_head - 2 * sizeof header_size) return false;
    const auto head = head_of(bytes.first(chunk_head));
    return head && head->kind == Head::Kind::chunk && head->size <= max_record;
  }

  std::optional<BagMessage> read_record(Bytes bytes, std::uint64_t position) override {
    const Record record(bytes);
    const auto connection = record.header.number<std::uint32_t>("conn");
    if (!connection) {
      corruption_.note(position, "a record without a connection");
      return std::nullopt;
    }
    const auto known = connections_.find(*connection);
    if (record.header.op() == Op::connection) {
      if (known != connections_.end() || connections_.size() == max_topics) return std::nullopt;
      const HeaderFields of_connection(record.data);
      connections_[*connection] =
          add({std::string(record.header.value("topic")),
               ros1_type(std::string(of_connection.value("type"))), RosSerialization::ros1},
              position);
      return std::nullopt;
    }
    const auto logged = record.header.time("time");
    if (known == connections_.end() || !logged) {
      corruption_.note(position, "a message without a connection or a time");
      return std::nullopt;
    }
    index_.read(*logged);
    if (!known->second) return std::nullopt;
    return BagMessage{*known->second, *logged, record.data, position};
  }

  std::optional<Bytes> records_of(Bytes bytes, std::uint64_t position, bool is_cut) override {
    ByteCursor fields(bytes);
    const HeaderFields header(fields.sized_bytes<std::uint32_t>());
    const auto size = header.number<std::uint32_t>("size");
    fields.number<std::uint32_t>();
    const auto content = decompressed(header.value("compression"), fields.rest());
    if (is_cut) return content;
    if (content && content->size() == size) return content;
    corruption_.note(position, "a chunk that does not decompress");
    return std::nullopt;
  }

  std::optional<Bytes> decompressed(std::string_view compression, Bytes content) {
    if (compression == "none") return content;
    if (compression == "bz2") return decompressed_bz2(content);
    const auto frame = decompressor_.decompress(FrameCodec::lz4, content, max_record);
    if (!frame) return std::nullopt;
    return frame->bytes;
  }

  /// Memory grows with the actual content, not with its stated size.
  std::optional<Bytes> decompressed_bz2(Bytes content) {
    constexpr std::size_t first_content = std::size_t{1} << 20;
    bz_stream stream{};
    if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::bad_alloc();
    // libbz2 does not change its input.
    stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(content.data()));  // NOLINT
    stream.avail_in = static_cast<unsigned>(content.size());
    const auto limit = expansion_.of(content.size(), max_record);
    std::size_t filled = 0;
    int result = BZ_OK;
    while (result == BZ_OK) {
      if (filled >= limit) break;
      if (filled == content_.size())
        content_.resize(std::min(limit, std::max(first_content, 2 * filled)));
      const auto room = std::min(content_.size(), limit) - filled;
      stream.next_out = reinterpret_cast<char*>(content_.data() + filled);
      stream.avail_out = static_cast<unsigned>(room);
      result = BZ2_bzDecompress(&stream);
      filled += room - stream.avail_out;
      if (result == BZ_OK && stream.avail_in == 0 && stream.avail_out == room) break;  // it is cut
    }
    BZ2_bzDecompressEnd(&stream);
    expansion_.count(filled);
    if (result != BZ_STREAM_END) return std::nullopt;
    return Bytes(content_).first(filled);
  }

  std::map<std::uint32_t, std::optional<std::size_t>> connections_;  ///< topics by connection
  FrameDecompressor decompressor_;
  std::vector<std::uint8_t> content_;  ///< of a chunk compressed with bzip2
  ExpansionLimit expansion_;           ///< of these chunks
};

}  // namespace

std::unique_ptr<BagFile> make_rosbag_file(BagFile::AddTopic add_topic) {
  return std::make_unique<RosbagFile>(std::move(add_topic));
}

}  // namespace eventcamera
