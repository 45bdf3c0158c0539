// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/mcap_encoder.hpp"

#include <zlib.h>

#include <algorithm>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/byte_cursor.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/ros/mcap_records.hpp"

namespace eventcamera {

namespace {

constexpr std::string_view topic = "/event_camera/events";
constexpr std::string_view frame = "event_camera";
constexpr std::string_view schema_name = "event_camera_msgs/msg/EventPacket";
/// Definition of the message and of those within it, separated as ROS 2 does.
constexpr std::string_view schema_text =
    "std_msgs/Header header\n"
    "uint32 height\n"
    "uint32 width\n"
    "uint64 seq\n"
    "uint64 time_base\n"
    "string encoding\n"
    "bool is_bigendian\n"
    "uint8[] events\n"
    "================================================================================\n"
    "MSG: std_msgs/Header\n"
    "builtin_interfaces/Time stamp\n"
    "string frame_id\n"
    "================================================================================\n"
    "MSG: builtin_interfaces/Time\n"
    "int32 sec\n"
    "uint32 nanosec\n";

constexpr std::uint16_t schema_id = 1;
constexpr std::uint16_t channel_id = 0;

/// Limits of a packet: time in microseconds, and size of its events in bytes.
constexpr Microseconds max_packet_time = 10'000;
constexpr std::size_t max_packet_bytes = std::size_t{1} << 15;
/// Limits of a chunk.
constexpr Microseconds max_chunk_time = 1'000'000;
constexpr std::size_t max_chunk_bytes = std::size_t{1} << 20;
/// Maximum pause that EVT3 words fill, so that readers that do not use the stamps count the wraps
/// of the clock: 10 minutes, which take 300 kB.
constexpr std::uint64_t max_filled_pause = 600'000'000;

/// Appends a record, whose content `put` appends.
template <class Put>
void put_record(McapOpcode opcode, std::vector<std::uint8_t>& out, const Put& put) {
  ByteAppender fields(out);
  fields.put(opcode);
  const auto size_at = out.size();
  fields.put(std::uint64_t{0});
  put(fields);
  const std::uint64_t size = out.size() - size_at - sizeof size;
  put_little_endian(size, out.data() + size_at);
}

void put_schema(std::vector<std::uint8_t>& out) {
  put_record(McapOpcode::schema, out, [](ByteAppender& fields) {
    fields.put(schema_id, schema_name, std::string_view("ros2msg"), schema_text);
  });
}

void put_channel(std::vector<std::uint8_t>& out) {
  put_record(McapOpcode::channel, out, [](ByteAppender& fields) {
    fields.put(channel_id, schema_id, topic, std::string_view("cdr"));
    fields.put(std::uint32_t{0});  // metadata
  });
}

std::string file_start() {
  std::vector<std::uint8_t> bytes(mcap_magic.begin(), mcap_magic.end());
  put_record(McapOpcode::header, bytes, [](ByteAppender& fields) {
    fields.put(std::string_view("ros2"), std::string_view("gst-eventsim"));
  });
  put_schema(bytes);
  put_channel(bytes);
  return {bytes.begin(), bytes.end()};
}

std::uint64_t nanoseconds(Microseconds t) {
  return static_cast<std::uint64_t>(t) * 1000;
}

/// Name of the encoding in a message, with its final zero.
constexpr std::string_view name_of(BagEvents events) {
  return events == BagEvents::evt3 ? std::string_view("evt3\0", 5) : std::string_view("mono\0", 5);
}

/// By BagCompression.
constexpr std::optional<FrameCodec> codecs[] = {std::nullopt, FrameCodec::lz4, FrameCodec::zstd};

class McapEncoder final : public Encoder {
 public:
  McapEncoder(const McapSettings& settings, const std::string& start)
      : Encoder(start),
        settings_(settings),
        position_(start.size()),
        compressor_(codecs[static_cast<std::size_t>(settings.compression)]),
        words_(settings.size.width) {}

  std::uint64_t pending() const override { return events_in_chunk_; }

 private:
  struct Chunk {
    Microseconds first;
    Microseconds last;
    std::uint64_t position;
    std::uint64_t size;        ///< of the record
    std::uint64_t index_size;  ///< of the message index that follows
    std::uint64_t stored_size;
    std::uint64_t content_size;
  };

  struct Message {
    Microseconds t;
    std::uint64_t offset;  ///< in the chunk
  };

  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    while (!events.empty()) {
      begin_or_continue(events.front().t, out);
      const auto end = packet_start_ + max_packet_time;
      auto few = events.first(std::min(events.size(), events_at_once));
      if (few.back().t >= end)
        few = few.first(static_cast<std::size_t>(
            std::ranges::partition_point(few, [&](const auto& event) { return event.t < end; }) -
            few.begin()));
      settings_.events == BagEvents::evt3 ? append_evt3(few) : append_mono(few);
      events_in_chunk_ += few.size();
      events = events.subspan(few.size());
    }
  }

  bool append_trigger(const Trigger& trigger, std::vector<std::uint8_t>& out) override {
    if (settings_.events != BagEvents::evt3 || trigger.id > Evt3Words::max_trigger_id) return false;
    begin_or_continue(trigger.t, out);
    WordWriter<std::uint16_t> words(chunk_);
    words.reserve(packet_words(trigger.t));
    words_.write_trigger(trigger, static_cast<std::uint64_t>(trigger.t), words);
    return true;
  }

  bool append_end(std::vector<std::uint8_t>& out) override {
    end_chunk(out);
    const auto before = out.size();
    put_record(McapOpcode::data_end, out,
               [](ByteAppender& fields) { fields.put(std::uint32_t{0}); });
    put_summary(position_ + out.size() - before, out);
    return false;
  }

  void append_evt3(std::span<const AbsoluteEvent> events) {
    WordWriter<std::uint16_t> words(chunk_);
    words.reserve(packet_words(events.front().t) + events.size() * Evt3Words::max_words);
    while (!events.empty())
      events =
          events.subspan(words_.write(events, static_cast<std::uint64_t>(events.front().t), words));
  }

  /// Words for the times of a packet, most of them for a pause before it.
  std::size_t packet_words(Microseconds t) const {
    return std::min(words_.steps_to(static_cast<std::uint64_t>(t)), max_filled_pause >> 12) +
           (max_packet_time >> 12) + 2 + Evt3Words::max_words;
  }

  void append_mono(std::span<const AbsoluteEvent> events) {
    WordWriter<std::uint64_t> words(chunk_);
    words.reserve(events.size());
    for (const auto& event : events)
      words.put(std::uint64_t{event.y_p} << 48 | std::uint64_t{event.x} << 32 |
                static_cast<std::uint64_t>(event.t - packet_start_) * 1000);
  }

  /// Begins another packet, and another chunk, if the next event or trigger does not fit.
  void begin_or_continue(Microseconds t, std::vector<std::uint8_t>& out) {
    if (packet_at_ && t - packet_start_ < max_packet_time &&
        chunk_.size() - events_at_ < max_packet_bytes)
      return;
    end_packet();
    if (!messages_.empty() &&
        (chunk_.size() >= max_chunk_bytes || t - messages_.front().t >= max_chunk_time))
      end_chunk(out);
    begin_packet(t);
  }

  /// Begins a message with a packet; end_packet() completes its sizes.
  void begin_packet(Microseconds t) {
    packet_at_ = chunk_.size();
    packet_start_ = t;
    messages_.push_back({t, *packet_at_});
    const auto time = nanoseconds(t);
    ByteAppender fields(chunk_);
    fields.put(McapOpcode::message, std::uint64_t{0});
    fields.put(channel_id, static_cast<std::uint32_t>(sequence_), time, time);
    fields.put(std::uint32_t{0x0100});  // little-endian CDR
    const auto start = chunk_.size();
    fields.put(static_cast<std::uint32_t>(time / 1'000'000'000),
               static_cast<std::uint32_t>(time % 1'000'000'000));
    fields.put(std::string_view(frame.data(), frame.size() + 1));
    fields.align(start, 4);
    fields.put(static_cast<std::uint32_t>(settings_.size.height),
               static_cast<std::uint32_t>(settings_.size.width));
    fields.align(start, 8);
    fields.put(std::uint64_t{sequence_++}, settings_.events == BagEvents::mono ? time : 0,
               name_of(settings_.events));
    fields.put(std::uint8_t{0});  // little-endian
    fields.align(start, 4);
    fields.put(std::uint32_t{0});
    events_at_ = chunk_.size();
    words_.begin_packet(static_cast<std::uint64_t>(t), max_filled_pause);
  }

  void end_packet() {
    if (!packet_at_) return;
    const std::uint64_t record = chunk_.size() - *packet_at_ - mcap_record_header;
    const auto events = static_cast<std::uint32_t>(chunk_.size() - events_at_);
    put_little_endian(record, chunk_.data() + *packet_at_ + 1);
    put_little_endian(events, chunk_.data() + events_at_ - sizeof events);
    packet_at_.reset();
  }

  void end_chunk(std::vector<std::uint8_t>& out) {
    end_packet();
    if (messages_.empty()) return;
    const auto before = out.size();
    Chunk chunk{messages_.front().t, messages_.back().t, position_, 0, 0, 0, chunk_.size()};
    put_record(McapOpcode::chunk, out, [&](ByteAppender& fields) {
      fields.put(nanoseconds(chunk.first), nanoseconds(chunk.last), chunk.content_size,
                 static_cast<std::uint32_t>(crc32_z(0, chunk_.data(), chunk_.size())),
                 compression(), std::uint64_t{0});
      const auto content_at = out.size();
      compressor_.compress(chunk_, out);
      chunk.stored_size = out.size() - content_at;
      put_little_endian(chunk.stored_size, out.data() + content_at - sizeof chunk.stored_size);
    });
    chunk.size = out.size() - before;
    put_record(McapOpcode::message_index, out, [&](ByteAppender& fields) {
      fields.put(channel_id,
                 static_cast<std::uint32_t>(messages_.size() * 2 * sizeof(std::uint64_t)));
      for (const auto& message : messages_) fields.put(nanoseconds(message.t), message.offset);
    });
    chunk.index_size = out.size() - before - chunk.size;
    position_ += out.size() - before;
    chunks_.push_back(chunk);
    message_count_ += messages_.size();
    messages_.clear();
    chunk_.clear();
    events_in_chunk_ = 0;
  }

  std::string_view compression() const {
    constexpr std::string_view names[] = {"", "lz4", "zstd"};
    return names[static_cast<std::size_t>(settings_.compression)];
  }

  /// Appends summary and footer. `summary_at` is the position of the former.
  void put_summary(std::uint64_t summary_at, std::vector<std::uint8_t>& out) const {
    struct Group {
      McapOpcode opcode;
      std::uint64_t start;
      std::uint64_t size;
    };
    const auto first = out.size();
    std::vector<Group> groups;
    const auto put_group = [&](McapOpcode opcode, const auto& put) {
      const auto before = out.size();
      put();
      if (out.size() > before)
        groups.push_back({opcode, summary_at + before - first, out.size() - before});
    };
    put_group(McapOpcode::schema, [&] { put_schema(out); });
    put_group(McapOpcode::channel, [&] { put_channel(out); });
    put_group(McapOpcode::statistics, [&] { put_statistics(out); });
    put_group(McapOpcode::chunk_index, [&] {
      for (const auto& chunk : chunks_) put_chunk_index(chunk, out);
    });
    const auto offsets_at = summary_at + out.size() - first;
    for (const auto& group : groups)
      put_record(McapOpcode::summary_offset, out,
                 [&](ByteAppender& fields) { fields.put(group.opcode, group.start, group.size); });
    // The checksum covers the summary and the footer up to it.
    std::uint32_t checksum = 0;
    put_record(McapOpcode::footer, out,
               [&](ByteAppender& fields) { fields.put(summary_at, offsets_at, checksum); });
    checksum = static_cast<std::uint32_t>(
        crc32_z(0, out.data() + first, out.size() - first - sizeof checksum));
    put_little_endian(checksum, out.data() + out.size() - sizeof checksum);
    out.insert(out.end(), mcap_magic.begin(), mcap_magic.end());
  }

  void put_statistics(std::vector<std::uint8_t>& out) const {
    put_record(McapOpcode::statistics, out, [&](ByteAppender& fields) {
      fields.put(message_count_);
      fields.put(std::uint16_t{1});  // schemas
      fields.put(std::uint32_t{1});  // channels
      fields.put(std::uint32_t{0});  // attachments
      fields.put(std::uint32_t{0});  // metadata
      fields.put(static_cast<std::uint32_t>(chunks_.size()),
                 chunks_.empty() ? 0 : nanoseconds(chunks_.front().first),
                 chunks_.empty() ? 0 : nanoseconds(chunks_.back().last),
                 static_cast<std::uint32_t>(sizeof channel_id + sizeof message_count_), channel_id,
                 message_count_);
    });
  }

  void put_chunk_index(const Chunk& chunk, std::vector<std::uint8_t>& out) const {
    put_record(McapOpcode::chunk_index, out, [&](ByteAppender& fields) {
      fields.put(nanoseconds(chunk.first), nanoseconds(chunk.last), chunk.position, chunk.size,
                 static_cast<std::uint32_t>(sizeof channel_id + sizeof chunk.position), channel_id,
                 chunk.position + chunk.size, chunk.index_size, compression(), chunk.stored_size,
                 chunk.content_size);
    });
  }

  McapSettings settings_;
  std::uint64_t position_;  ///< of the next chunk in the file
  FrameCompressor compressor_;

  std::vector<std::uint8_t> chunk_;  ///< records of the chunk being written
  std::vector<Message> messages_;    ///< messages of the chunk
  std::uint64_t events_in_chunk_ = 0;
  std::optional<std::size_t> packet_at_;  ///< message being written, in the chunk
  std::size_t events_at_ = 0;             ///< its events
  Microseconds packet_start_ = 0;         ///< time of the first
  Evt3Words words_;

  std::uint64_t sequence_ = 0;
  std::uint64_t message_count_ = 0;
  std::vector<Chunk> chunks_;
};

}  // namespace

std::unique_ptr<Encoder> make_mcap_encoder(const McapSettings& settings) {
  if (settings.events == BagEvents::evt3 &&
      std::max(settings.size.width, settings.size.height) > max_evt_side)
    throw std::invalid_argument("EVT3 words support sensors of 1x1 to 2048x2048 pixels");
  return std::make_unique<McapEncoder>(settings, file_start());
}

}  // namespace eventcamera
