// SPDX-License-Identifier: LGPL-2.1-or-later
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "src/formats/byte_cursor.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/ros/chunked_bag_file.hpp"
#include "src/formats/ros/mcap_records.hpp"

namespace eventcamera {

namespace {

Microseconds microseconds(std::uint64_t nanoseconds) {
  return static_cast<Microseconds>(nanoseconds / 1000);
}

/// Content of a chunk record.
struct Chunk {
  std::uint64_t size;
  std::uint32_t checksum;
  std::string_view compression;
  std::uint64_t stored_size;

  explicit Chunk(ByteCursor& fields) {
    fields.number<std::uint64_t>();  // first time
    fields.number<std::uint64_t>();  // last time
    size = fields.number<std::uint64_t>();
    checksum = fields.number<std::uint32_t>();
    compression = fields.text();
    stored_size = fields.number<std::uint64_t>();
  }
};

bool is_compression(std::string_view name) {
  return name.empty() || name == "lz4" || name == "zstd";
}

/// Size of a chunk record's fields before its records, without the name of the compression.
constexpr std::size_t chunk_fields = 40;

/// Bytes needed to recognise a chunk.
constexpr std::size_t chunk_head = mcap_record_header + chunk_fields + 4;

bool begins_chunk(std::span<const std::uint8_t> bytes) {
  if (bytes[0] != static_cast<std::uint8_t>(McapOpcode::chunk)) return false;
  ByteCursor fields(bytes.subspan(1));
  const auto size = fields.number<std::uint64_t>();
  const Chunk chunk(fields);
  return !fields.failed() && is_compression(chunk.compression) &&
         size == chunk_fields + chunk.compression.size() + chunk.stored_size;
}

/// True for records without messages or channels.
bool is_skipped(std::uint8_t opcode) {
  constexpr std::uint8_t first_private = 0x80;
  return (opcode >= static_cast<std::uint8_t>(McapOpcode::message_index) &&
          opcode <= static_cast<std::uint8_t>(McapOpcode::summary_offset)) ||
         opcode >= first_private;
}

class McapFile final : public ChunkedBagFile {
 public:
  explicit McapFile(AddTopic add_topic)
      : ChunkedBagFile(std::move(add_topic), mcap_magic, chunk_head) {}

 private:
  void read_index(ByteSource& source) override {
    constexpr std::size_t end_size = mcap_record_header + mcap_footer + mcap_magic.size();
    const auto size = source.size();
    if (size < mcap_magic.size() + end_size) return;
    std::array<std::uint8_t, end_size> end = {};
    if (source.read(size - end_size, end) != end_size) return;
    ByteCursor footer(end);
    if (footer.number<std::uint8_t>() != static_cast<std::uint8_t>(McapOpcode::footer) ||
        footer.number<std::uint64_t>() != mcap_footer)
      return;
    const auto summary_at = footer.number<std::uint64_t>();
    const auto summary_end = size - end_size;
    if (summary_at < mcap_magic.size() || summary_at >= summary_end ||
        summary_end - summary_at > max_index)
      return;
    std::vector<std::uint8_t> bytes(summary_end - summary_at);
    if (source.read(summary_at, bytes) != bytes.size()) return;

    std::vector<ChunkIndex::Chunk> chunks;
    std::map<std::uint16_t, std::uint64_t> first;  // chunk of each channel
    ByteCursor records(bytes);
    while (!records.rest().empty()) {
      const auto record_at = summary_at + records.position();
      const auto opcode = static_cast<McapOpcode>(records.number<std::uint8_t>());
      ByteCursor content(records.sized_bytes<std::uint64_t>());
      if (records.failed()) return;
      if (opcode == McapOpcode::schema) add_schema(content, record_at);
      if (opcode == McapOpcode::channel) add_channel(content, record_at);
      if (opcode != McapOpcode::chunk_index) continue;
      content.number<std::uint64_t>();  // first time
      const auto last = microseconds(content.number<std::uint64_t>());
      const auto position = content.number<std::uint64_t>();
      content.number<std::uint64_t>();  // its size
      ByteCursor indexes(content.sized_bytes<std::uint32_t>());
      if (content.failed()) continue;
      chunks.push_back({position, last});
      while (!indexes.failed() && !indexes.rest().empty()) {
        auto& chunk = first.try_emplace(indexes.number<std::uint16_t>(), position).first->second;
        chunk = std::min(chunk, position);
        indexes.number<std::uint64_t>();  // where the index of its messages is
      }
    }
    for (const auto& [channel, position] : first)
      if (const auto known = channels_.find(channel); known != channels_.end() && known->second)
        index_.set_topic(*known->second, position);
    index_.set(std::move(chunks), mcap_magic.size());
  }

  std::optional<Head> head_of(Bytes bytes) const override {
    if (bytes.size() < mcap_record_header) return std::nullopt;
    const auto content = little_endian<std::uint64_t>(bytes.data() + 1);
    const auto size = content + std::min(mcap_record_header, ~std::uint64_t{0} - content);
    if (is_skipped(bytes[0])) return Head{Head::Kind::skipped, size};
    switch (static_cast<McapOpcode>(bytes[0])) {
      case McapOpcode::chunk:
        if (bytes.size() < std::min<std::uint64_t>(size, chunk_head)) return std::nullopt;
        return Head{begins_chunk(bytes) ? Head::Kind::chunk : Head::Kind::none, size};
      case McapOpcode::header:
      case McapOpcode::schema:
      case McapOpcode::channel:
      case McapOpcode::message:
        return Head{Head::Kind::read, size};
      case McapOpcode::data_end:
      case McapOpcode::footer:
        return Head{Head::Kind::end, size};
      default:
        return Head{};
    }
  }

  bool begins_record(Bytes bytes) const override {
    const auto size = little_endian<std::uint64_t>(bytes.data() + 1);
    if (bytes[0] != static_cast<std::uint8_t>(McapOpcode::message)) return begins_chunk(bytes);
    return size >= mcap_message_header && size <= max_record &&
           channels_.contains(little_endian<std::uint16_t>(bytes.data() + mcap_record_header));
  }

  std::optional<BagMessage> read_record(Bytes record, std::uint64_t position) override {
    const ByteCursor content(record.subspan(mcap_record_header));
    switch (static_cast<McapOpcode>(record[0])) {
      case McapOpcode::schema:
        add_schema(content, position);
        break;
      case McapOpcode::channel:
        add_channel(content, position);
        break;
      case McapOpcode::message:
        return message_of(content, position);
      default:
        break;
    }
    return std::nullopt;
  }

  std::optional<Bytes> records_of(Bytes record, std::uint64_t position, bool is_cut) override {
    ByteCursor fields(record.subspan(mcap_record_header));
    const Chunk chunk(fields);
    auto records = fields.rest();
    if (!chunk.compression.empty()) {
      const auto codec = chunk.compression == "lz4" ? FrameCodec::lz4 : FrameCodec::zstd;
      const auto content = decompressor_.decompress(codec, records, max_record);
      if (!content || content->bytes.size() != chunk.size) {
        if (!is_cut) corruption_.note(position, "a chunk that does not decompress");
        return std::nullopt;
      }
      records = content->bytes;
    }
    if (chunk.checksum != 0 && !is_cut &&
        crc32_z(0, records.data(), records.size()) != chunk.checksum)
      corruption_.note(position, "a chunk with a wrong checksum");
    return records;
  }

  void add_schema(ByteCursor content, std::uint64_t position) {
    const auto id = content.number<std::uint16_t>();
    const auto name = content.text();
    if (name.size() > max_name)
      corruption_.note(position, "a type with an overlong name");
    else if (!content.failed() && schemas_.size() < max_topics)
      schemas_.try_emplace(id, name);
  }

  void add_channel(ByteCursor content, std::uint64_t position) {
    const auto id = content.number<std::uint16_t>();
    const auto schema = schemas_.find(content.number<std::uint16_t>());
    const auto name = content.text();
    const auto encoding = content.text();
    if (content.failed() || channels_.contains(id) || channels_.size() == max_topics) return;
    BagTopic topic{std::string(name), {}, {}};
    if (schema != schemas_.end()) topic.type = ros1_type(schema->second);
    if (encoding == "cdr") topic.serialization = RosSerialization::cdr;
    if (encoding == "ros1") topic.serialization = RosSerialization::ros1;
    channels_[id] = add(topic, position);
  }

  std::optional<BagMessage> message_of(ByteCursor content, std::uint64_t position) {
    const auto channel = channels_.find(content.number<std::uint16_t>());
    content.number<std::uint32_t>();  // its number
    const auto logged = microseconds(content.number<std::uint64_t>());
    content.number<std::uint64_t>();  // time of publication
    if (content.failed() || channel == channels_.end()) {
      corruption_.note(position, "a message without a channel");
      return std::nullopt;
    }
    index_.read(logged);
    if (!channel->second) return std::nullopt;
    return BagMessage{*channel->second, logged, content.rest(), position};
  }

  std::map<std::uint16_t, std::string> schemas_;                  ///< names of the types
  std::map<std::uint16_t, std::optional<std::size_t>> channels_;  ///< topics by channel
  FrameDecompressor decompressor_;
};

}  // namespace

std::unique_ptr<BagFile> make_mcap_file(BagFile::AddTopic add_topic) {
  return std::make_unique<McapFile>(std::move(add_topic));
}

}  // namespace eventcamera
