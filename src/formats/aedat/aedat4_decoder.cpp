// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "src/core/byte_order.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_flatbuffer.hpp"
#include "src/formats/byte_queue.hpp"
#include "src/formats/chunker.hpp"

namespace eventcamera {

namespace {

using aedat4::size_prefix;

constexpr std::size_t identifier_at = 2 * size_prefix;
constexpr std::size_t identifier_size = 4;
/// Bytes of a payload needed to recognise it.
constexpr std::size_t payload_head = identifier_at + identifier_size;
constexpr std::size_t packet_head = aedat4_packet_header + payload_head;

constexpr int max_unlisted_streams = 256;
/// Searching a packet with a corrupt size for the next one repeats work. This bounds that work in
/// malicious files, in bytes.
constexpr std::size_t max_credit = std::size_t{256} << 20;
/// Work charged for a failed decompression, besides the packet's bytes.
constexpr std::size_t decompressing = std::size_t{4} << 20;

/// Elements returned at once; they fit into the L2 cache.
constexpr std::size_t block = 4096;

constexpr std::size_t event_size = sizeof(aedat4::Event);
static_assert(event_size == sizeof(AbsoluteEvent));

bool is_time(Microseconds t) {
  return t > -aedat4_last_time && t < aedat4_last_time;
}

/// Does not check column and row.
AbsoluteEvent event_at(const std::uint8_t* bytes) {
  // t:64, x:16, y:16, on:8, padding:24
  const auto word = little_endian<std::uint64_t>(bytes + 8);
  const auto on = static_cast<std::uint16_t>(((word >> 32) & 0xff) != 0 ? 0x8000 : 0);
  return {little_endian<Microseconds>(bytes), static_cast<std::uint16_t>(word),
          static_cast<std::uint16_t>(((word >> 16) & 0x7fff) | on)};
}

int row_at(const std::uint8_t* bytes) {
  return little_endian<std::uint16_t>(bytes + 10);
}

/// Limit of valid coordinates; an unknown size gives the maximum.
SensorSize limit_of(SensorSize size) {
  return {size.width != 0 ? size.width : max_side, size.height != 0 ? size.height : max_side};
}

Trigger trigger_of(const aedat4::Trigger& trigger) {
  const auto source = static_cast<std::size_t>(static_cast<std::uint8_t>(trigger.source()));
  const auto edge =
      source < aedat4_edges.size() ? aedat4_edges[source] : Aedat4Edge{.id = 6, .rising = true};
  return {trigger.t(), edge.id, edge.rising};
}

ImuSample imu_sample_of(const aedat4::Imu& imu) {
  return {imu.t(),
          imu.temperature(),
          {imu.acceleration_x(), imu.acceleration_y(), imu.acceleration_z()},
          {imu.rotation_x(), imu.rotation_y(), imu.rotation_z()},
          {imu.magnetic_field_x(), imu.magnetic_field_y(), imu.magnetic_field_z()}};
}

/// Elements of an AEDAT4 packet: events, triggers, IMU samples or a frame. Checks the packet, then
/// returns its elements in blocks, without invalid ones.
class Aedat4Elements {
 public:
  static constexpr const char* broken_packet = "a packet whose FlatBuffer is corrupt";

  explicit Aedat4Elements(Corruption& corruption) : corruption_(corruption), events_(block) {
    triggers_.reserve(block);
  }

  /// Reads a packet at `position`, whose FlatBuffer `content` must stay valid until all elements
  /// were returned. Returns a description of its corruption, or nullptr.
  const char* read(StreamKind kind, std::span<const std::uint8_t> content, std::uint64_t position) {
    if (kind == StreamKind::frames) return read_frame(content);
    std::optional<aedat4::Elements> elements = aedat4::Elements{};
    if (kind == StreamKind::events)
      elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
    else if (kind == StreamKind::triggers)
      elements = aedat4::verified_elements<aedat4::Tables<aedat4::Trigger>>(content, "TRIG");
    else if (kind == StreamKind::imu)
      elements = aedat4::verified_elements<aedat4::Tables<aedat4::Imu>>(content, "IMUS");
    if (!elements) return broken_packet;
    kind_ = kind;
    data_ = elements->data;
    count_ = elements->count;
    position_ = position;
    return nullptr;
  }

  /// True once all elements were returned.
  bool empty() const { return count_ == 0 && !frame_; }

  /// Returns the next elements as items of `stream`, whose sensor has this size.
  Item next(std::size_t stream, SensorSize size) {
    if (frame_) return FrameItem{stream, *std::exchange(frame_, std::nullopt)};
    if (kind_ == StreamKind::events) return EventItem{stream, next_events(size)};
    if (kind_ == StreamKind::triggers) {
      read_tables(trigger_of, "a trigger at an impossible time", triggers_);
      return TriggerItem{stream, triggers_};
    }
    read_tables(imu_sample_of, "an IMU sample at an impossible time", imu_samples_);
    return ImuItem{stream, imu_samples_};
  }

  /// Drops the rest of the packet.
  void clear() {
    count_ = 0;
    frame_.reset();
  }

  /// True if all events of a packet are valid and in order, and for all other packets.
  static bool are_sound_events(std::span<const std::uint8_t> content, SensorSize size) {
    const auto elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
    if (!elements) return true;
    const auto limit = limit_of(size);
    auto last = std::numeric_limits<Microseconds>::min();
    for (std::size_t i = 0; i < elements->count; ++i) {
      const auto* const bytes = elements->data + i * event_size;
      const auto event = event_at(bytes);
      if (event.x >= limit.width || row_at(bytes) >= limit.height || event.t < last ||
          !is_time(event.t) || little_endian<std::uint32_t>(bytes + 12) > 1)
        return false;
      last = event.t;
    }
    return true;
  }

 private:
  const char* read_frame(std::span<const std::uint8_t> content) {
    const auto* const packet = aedat4::verified<aedat4::Frame>(content, "FRME");
    if (packet == nullptr) return broken_packet;
    const auto format = static_cast<PixelFormat>(packet->format());
    const auto pixel = bytes_per_pixel(format);
    if (pixel == 0) return nullptr;  // an unknown format
    const auto pixels = aedat4::elements_of(packet->pixels());
    if (packet->width() <= 0 || packet->height() <= 0 ||
        pixels.count != std::size_t{1} * packet->width() * packet->height() * pixel)
      return "a frame whose payload does not match its dimensions";
    for (const auto t : {packet->t(), packet->begin_t(), packet->end_t(),
                         packet->exposure_begin_t(), packet->exposure_end_t(), packet->exposure()})
      if (!is_time(t)) return "a frame at an impossible time";
    Frame frame{packet->t(),
                packet->begin_t(),
                packet->end_t(),
                packet->exposure_begin_t(),
                packet->exposure_end_t(),
                format,
                packet->width(),
                packet->height(),
                packet->offset_x(),
                packet->offset_y(),
                pixels.data,
                std::ptrdiff_t{1} * packet->width() * pixel};
    // Newer files only have the time and the length of the exposure.
    if (frame.begin == 0 && frame.end == 0 && frame.exposure_begin == 0 &&
        frame.exposure_end == 0) {
      frame.begin = frame.exposure_begin = frame.t;
      frame.end = frame.exposure_end = frame.t + packet->exposure();
    }
    frame_ = frame;
    return nullptr;
  }

  /// A valid block takes a single pass.
  std::span<const AbsoluteEvent> next_events(SensorSize size) {
    const auto count = std::min(count_, block);
    const auto* const from = data_;
    data_ += count * event_size;
    count_ -= count;
    const auto limit = limit_of(size);
    const auto width = limit.width;
    const auto height = limit.height;
    auto last = std::numeric_limits<Microseconds>::min();
    bool sound = true;
    for (std::size_t i = 0; i < count; ++i) {
      const auto* const bytes = from + i * event_size;
      const auto event = event_at(bytes);
      sound &= (event.x < width) & (row_at(bytes) < height) & (event.t >= last);
      last = event.t;
      events_[i] = event;
    }
    if (sound && is_time(events_[0].t) && is_time(last)) return {events_.data(), count};

    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto* const bytes = from + i * event_size;
      const auto event = event_at(bytes);
      if (!is_time(event.t)) {
        corruption_.note(position_, "an event at an impossible time");
      } else if (event.x >= width || row_at(bytes) >= height) {
        ++corruption_.outside;
      } else {
        events_[kept++] = event;
      }
    }
    return {events_.data(), kept};
  }

  /// Reads the next block of elements that are tables.
  template <class Table, class Element>
  void read_tables(Element (*element_of)(const Table&), const char* corruption,
                   std::vector<Element>& out) {
    const auto count = std::min(count_, block);
    const aedat4::Elements tables{data_, count};
    out.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const auto* const table = tables.table<Table>(i);
      if (is_time(table->t()))
        out.push_back(element_of(*table));
      else
        corruption_.note(position_, corruption);
    }
    data_ += count * sizeof(flatbuffers::uoffset_t);
    count_ -= count;
  }

  Corruption& corruption_;
  StreamKind kind_ = StreamKind::other;
  const std::uint8_t* data_ = nullptr;  ///< elements not returned yet
  std::size_t count_ = 0;               ///< their number
  std::uint64_t position_ = 0;
  std::optional<Frame> frame_;
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;
  std::vector<ImuSample> imu_samples_;
};

/// True for the entries of older versions of DV, which state neither times nor counts.
bool is_blank(const Aedat4TableEntry& entry) {
  return entry.elements == 0 && entry.start == 0 && entry.end == 0;
}

class Aedat4Decoder final : public Decoder {
 public:
  void push(std::span<const std::uint8_t> piece) override {
    if (packet_ != 0) throw std::logic_error("push() before next() returned nothing");
    queue_.push(piece);
  }

  void drain() override { finished_ = true; }

  std::optional<Item> next() override {
    while (true) {
      if (!elements_.empty()) return elements_.next(stream_, streams_[stream_].size);
      queue_.consume(std::exchange(packet_, 0));
      const bool ready = header_read() || read_header();
      if (!ready || !find_packet() || !read_packet()) {
        if (finished_ && ready) note_missing_table();
        break;
      }
    }
    queue_.keep();
    return std::nullopt;
  }

  /// Gives access to the packet table, which is read once the header has been.
  bool open(ByteSource& source) override {
    source_ = &source;
    return false;
  }

  /// Streams listed in the header, and any others found in packets.
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return corruption_; }

  /// Uses the packet table if there is one; otherwise the position of the first packet.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    if (!header_read()) return std::nullopt;
    const bool from_start = table_.empty() || t == std::numeric_limits<Microseconds>::min();
    return SeekPoint{.t = t,
                     .position = from_start
                                     ? header_.packets_at
                                     : aedat4_position_of(table_, t).value_or(*header_.table_at)};
  }

  void restart(const SeekPoint& seek_point) override {
    queue_.restart(seek_point.position);
    elements_.clear();
    packet_ = 0;
    finished_ = false;
    scanning_ = false;
    table_reported_ = false;
  }

  std::optional<Microseconds> last_time() override {
    std::optional<Microseconds> last;
    for (const auto& stream : streams_) {
      const auto extent = extents_.find(stream.id);
      if (extent == extents_.end()) continue;
      if (stream.kind == StreamKind::events || stream.kind == StreamKind::frames)
        last = std::max(last, extent->second.last);  // none is the minimum
    }
    return last;
  }

  std::optional<std::uint64_t> end_of(std::size_t stream, Microseconds t) const override {
    if (table_.empty()) return std::nullopt;
    const auto extent = extents_.find(streams_[stream].id);
    if (extent == extents_.end()) return 0;
    if (extent->second.latest_start < t) return extent->second.end;
    std::uint64_t end = 0;
    for (const auto& entry : table_)
      if (entry.stream == streams_[stream].id && entry.start < t)
        end = std::max(end, entry.position + 1);
    return end;
  }

  std::uint64_t position() const override { return queue_.position(); }
  std::string format_name() const override { return "AEDAT 4.0"; }

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

  bool read_header() {
    auto header = read_aedat4_header(queue_.peek(queue_.size()));
    if (!header) {
      if (finished_) throw UnsupportedFormat("this AEDAT4 file ends within its header");
      return false;
    }
    if (!header->lists_streams)
      corruption_.note(aedat4_magic.size(), "the header's XML is corrupt");
    header_ = *std::move(header);
    streams_ = header_.streams;
    listed_ = header_.lists_streams && !streams_.empty();
    queue_.consume(header_.packets_at);
    read_table();
    return true;
  }

  /// Moves on to the next packet. False if more bytes are needed.
  bool find_packet() {
    for (auto place = place_at(0); place != Place::packet; place = place_at(0)) {
      if (place == Place::more || place == Place::end) return false;
      // The table follows the last packet, but search for further packets anyway.
      if (!std::exchange(scanning_, true)) {
        if (place == Place::noise)
          corruption_.note(queue_.position(), "bytes that are not a packet");
        else if (!table_found_at_)
          table_found_at_ = queue_.position();
      }
      queue_.consume(1);
    }
    scanning_ = false;
    return true;
  }

  /// Reads the packet at the front. False if more bytes are needed.
  bool read_packet() {
    const auto head = queue_.peek(packet_head);
    const auto id = little_endian<std::int32_t>(head.data());
    const std::size_t size = little_endian<std::uint32_t>(head.data() + 4);
    const auto packet = aedat4_packet_header + size;
    if (queue_.peek(packet).empty()) {
      if (!finished_) return false;
      corruption_.note(queue_.position(), "a packet truncated by the end of the file");
      queue_.consume(aedat4_packet_header);
      scanning_ = true;
      return true;
    }
    // A packet with a corrupt size covers others or ends within one, as the next bytes show.
    // Without compression, missing bytes show in no other way.
    auto after = is_compressed() ? Place::packet : place_at(packet);
    const auto payload = unpacked(queue_.peek(packet).subspan(aedat4_packet_header, size));
    if (is_compressed() && payload.used != size) after = place_at(packet);
    if (after == Place::more) return false;

    const auto* const corruption = read_content(payload, id, after);
    if (corruption == nullptr) {
      packet_ = packet;
      if (after == Place::noise && payload.used != size) {
        packet_ = aedat4_packet_header + payload.used;
        corruption_.note(queue_.position(), "a packet of the wrong size");
        scanning_ = true;
      }
      credit_ = std::min(max_credit, credit_ + packet);
      return true;
    }
    if (is_compressed()) after = place_at(packet);
    if (after == Place::more) return false;
    corruption_.note(queue_.position(), corruption);
    skip_corrupt(payload, size, after);
    return true;
  }

  Place place_at(std::size_t offset) {
    const auto count = std::min(queue_.size(), offset + packet_head);
    const auto bytes = queue_.peek(count).subspan(offset, count - offset);
    if (bytes.size() < packet_head) {
      if (!finished_) return Place::more;
      if (bytes.empty()) return Place::end;
    } else {
      if (begins_packet(bytes)) return Place::packet;
      const auto* const identifier = bytes.data() + identifier_at;
      if (std::equal(identifier, identifier + identifier_size, "FTAB")) return Place::table;
      if (is_compressed() && begins_frame(codec_of(header_.compression), bytes))
        return Place::table;
    }
    return header_.table_at == queue_.position() + offset ? Place::table : Place::noise;
  }

  bool begins_packet(std::span<const std::uint8_t> bytes) const {
    const auto id = little_endian<std::int32_t>(bytes.data());
    const auto size = little_endian<std::uint32_t>(bytes.data() + 4);
    if (size < payload_head || size > aedat4_max_packet) return false;
    if (!may_have_stream(id)) return false;
    const auto payload = bytes.subspan(aedat4_packet_header);
    if (is_compressed()) return begins_frame(codec_of(header_.compression), payload);
    if (little_endian<std::uint32_t>(payload.data()) > size - size_prefix) return false;
    const auto identifier = payload.subspan(identifier_at, identifier_size);
    return std::all_of(identifier.begin(), identifier.end(), [](std::uint8_t c) {
      return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    });
  }

  bool may_have_stream(int id) const {
    return listed_ ? stream_of(id).has_value() : id >= 0 && id < max_unlisted_streams;
  }

  bool header_read() const { return header_.packets_at != 0; }
  bool is_compressed() const { return header_.compression != Aedat4Compression::none; }

  Payload unpacked(std::span<const std::uint8_t> payload) {
    const auto flatbuffer_size = [](std::span<const std::uint8_t> bytes) {
      return size_prefix + little_endian<std::uint32_t>(bytes.data());
    };
    if (!is_compressed()) {
      const auto used = flatbuffer_size(payload);
      return {payload.first(used), used};
    }
    const auto decompressed =
        decompressor_.decompress(codec_of(header_.compression), payload, aedat4_max_packet);
    if (!decompressed) return {};
    auto content = decompressed->bytes;
    if (content.size() >= payload_head)
      content = content.first(std::min(content.size(), flatbuffer_size(content)));
    return {content, decompressed->used};
  }

  /// Reads the payload of a packet, which `after` follows. Returns a description of its corruption,
  /// or nullptr.
  const char* read_content(const Payload& payload, int id, Place after) {
    const auto content = payload.content;
    if (payload.used == 0) return "a packet that does not decompress";
    if (content.size() < payload_head) return Aedat4Elements::broken_packet;
    const auto kind = aedat4_kind(
        {reinterpret_cast<const char*>(content.data()) + identifier_at, identifier_size});
    const auto stream = stream_of(id);
    if (!is_compressed() && after == Place::noise && stream &&
        !Aedat4Elements::are_sound_events(content, streams_[*stream].size))
      return "a packet with missing bytes";
    if (stream && streams_[*stream].kind != kind)
      return "a packet of a different kind than its stream";
    if (kind == StreamKind::other) return nullptr;
    const auto* const corruption = elements_.read(kind, content, queue_.position());
    if (corruption != nullptr) return corruption;
    stream_ = stream.value_or(streams_.size());
    if (!stream) streams_.push_back({id, kind, {}, {}});  // the header does not list it
    return nullptr;
  }

  std::optional<std::size_t> stream_of(int id) const {
    for (std::size_t i = 0; i < streams_.size(); ++i)
      if (streams_[i].id == id) return i;
    return std::nullopt;
  }

  void read_table() {
    // Larger tables, of recordings of many days, are not read.
    constexpr std::uint64_t max_table = std::uint64_t{1} << 26;
    if (source_ == nullptr || !header_.table_at) return;
    std::vector<std::uint8_t> bytes;
    const auto size = source_->size();
    if (size > *header_.table_at && size - *header_.table_at <= max_table)
      bytes.resize(size - *header_.table_at);
    if (!bytes.empty() && source_->read(*header_.table_at, bytes) != bytes.size()) bytes.clear();
    auto table = read_aedat4_table(bytes, header_.compression, header_.packets_at);
    table_missing_ = !table;
    if (table && !std::ranges::all_of(*table, is_blank)) table_ = std::move(*table);
    for (const auto& entry : table_) {
      if (!may_have_stream(entry.stream)) continue;
      auto& extent = extents_[entry.stream];
      if (entry.start < Chunker::max_time) {
        extent.end = std::max(extent.end, entry.position + 1);
        extent.latest_start = std::max(extent.latest_start, entry.start);
      }
      if (entry.end < Chunker::max_time)
        extent.last = std::max(extent.last.value_or(entry.end), entry.end);
    }
  }

  /// A missing table is reported after all other corruption, which may be its cause.
  void note_missing_table() {
    if (!table_missing_ || std::exchange(table_reported_, true)) return;
    const auto at = header_.table_at.value_or(0);
    if (table_found_at_ && *table_found_at_ != at)
      corruption_.note(header_.table_field_at,
                       "the header has a wrong position for the packet table");
    else if (source_->size() <= at)
      corruption_.note(source_->size(), "the file ends before its packet table");
    else
      corruption_.note(at, "the packet table that the header states is missing");
  }

  /// Skips a corrupt packet if it is followed by something valid, else searches it for packets that
  /// it has swallowed.
  void skip_corrupt(const Payload& payload, std::size_t size, Place after) {
    const auto packet = aedat4_packet_header + size;
    if (after != Place::noise) {
      queue_.consume(packet);
      return;
    }
    scanning_ = true;
    const auto work = size + (payload.used == 0 ? decompressing : payload.content.size());
    const bool affordable = work <= credit_;
    if (affordable) credit_ -= work;
    // A packet that decompresses contains no further packets.
    const auto sound = is_compressed() ? payload.used : 0;
    queue_.consume(affordable ? aedat4_packet_header + sound : packet);
  }

  ByteQueue queue_;
  Corruption corruption_;
  bool finished_ = false;
  bool scanning_ = false;  ///< searching for the next packet
  bool listed_ = false;    ///< the header lists all streams
  Aedat4Header header_;
  std::optional<std::uint64_t> table_found_at_;  ///< while reading
  ByteSource* source_ = nullptr;                 ///< set by open()
  std::vector<Aedat4TableEntry> table_;
  std::map<int, Extent> extents_;  ///< by stream ID
  bool table_missing_ = false;     ///< although the header states one
  bool table_reported_ = false;
  std::vector<StreamInfo> streams_;
  FrameDecompressor decompressor_;

  std::size_t packet_ = 0;  ///< size of the packet being returned
  std::size_t stream_ = 0;  ///< its stream
  Aedat4Elements elements_{corruption_};

  std::size_t credit_ = max_credit;  ///< remaining work for searching corrupt packets
};

}  // namespace

std::unique_ptr<Decoder> make_aedat4_decoder() {
  return std::make_unique<Aedat4Decoder>();
}

}  // namespace eventcamera
