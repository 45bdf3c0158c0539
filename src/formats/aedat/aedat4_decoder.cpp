// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_decoder.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "src/core/max_side.hpp"
#include "src/formats/aedat/aedat4_flatbuffer.hpp"
#include "src/formats/aedat/aedat4_info_node.hpp"
#include "src/formats/byte_order.hpp"
#include "src/formats/chunker.hpp"

namespace eventcamera {

namespace {

using aedat4::size_prefix;

constexpr std::size_t identifier_at = 2 * size_prefix;
constexpr std::size_t identifier_size = 4;
/// Bytes of a payload needed to recognise it.
constexpr std::size_t payload_head = identifier_at + identifier_size;
constexpr std::size_t packet_head = aedat4_packet_header + payload_head;

constexpr std::size_t max_header = std::size_t{16} << 20;
constexpr int max_unlisted_streams = 256;
/// Elements returned at once; they fit into the L2 cache.
constexpr std::size_t block = 4096;
/// Searching a packet with a corrupt size for the next one repeats work. This bounds that work in
/// malicious files, in bytes.
constexpr std::size_t max_credit = std::size_t{256} << 20;
/// Work charged for a failed decompression, besides the packet's bytes.
constexpr std::size_t decompressing = std::size_t{4} << 20;

constexpr std::size_t event_size = sizeof(aedat4::Event);
static_assert(event_size == sizeof(AbsoluteEvent));

constexpr const char* broken_packet = "a packet whose FlatBuffer is corrupt";

bool is_time(Microseconds t) {
  return t > -aedat4_last_time && t < aedat4_last_time;
}

/// Returns the event at `bytes`, without checking column and row.
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

/// True for the entries of older versions of DV, which state neither times nor counts.
bool is_blank(const Aedat4TableEntry& entry) {
  return entry.elements == 0 && entry.start == 0 && entry.end == 0;
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

}  // namespace

Aedat4Decoder::Aedat4Decoder() : events_(block), credit_(max_credit) {
  triggers_.reserve(block);
}

void Aedat4Decoder::push(std::span<const std::uint8_t> piece) {
  if (packet_ != 0) throw std::logic_error("Aedat4Decoder::push() before next() returned nothing");
  queue_.push(piece);
}

std::optional<Item> Aedat4Decoder::next() {
  while (true) {
    if (elements_.count > 0) return next_elements();
    queue_.consume(std::exchange(packet_, 0));
    const bool ready = header_read() || read_header();
    if (!ready || (scanning_ && !scan()) || !read_packet()) {
      if (finished_ && ready) note_missing_table();
      break;
    }
    if (frame_) return *std::exchange(frame_, std::nullopt);
  }
  queue_.keep();
  return std::nullopt;
}

void Aedat4Decoder::resume(std::uint64_t position) {
  queue_.restart(position);
  elements_ = {};
  packet_ = 0;
  frame_.reset();
  finished_ = false;
  scanning_ = false;
  table_reported_ = false;
}

bool Aedat4Decoder::read_header() {
  const auto start = queue_.peek(std::min(queue_.size(), aedat4_magic.size()));
  if (!std::equal(
          start.begin(),
          start.begin() + static_cast<std::ptrdiff_t>(std::min(start.size(), aedat4_magic.size())),
          aedat4_magic.begin()))
    throw UnsupportedFormat("this is not AEDAT4: it does not begin with " +
                            std::string(aedat4_magic.substr(0, aedat4_magic.size() - 2)));
  const auto size_at = aedat4_magic.size();
  const auto before = size_at + size_prefix;
  auto bytes = queue_.peek(before);
  const auto size = bytes.empty() ? 0 : little_endian<std::uint32_t>(bytes.data() + size_at);
  if (size > max_header)
    throw UnsupportedFormat("this AEDAT4 file claims a header of " + std::to_string(size) +
                            " bytes");
  if (!bytes.empty()) bytes = queue_.peek(before + size);
  if (bytes.empty()) {
    if (finished_) throw UnsupportedFormat("this AEDAT4 file ends within its header");
    return false;
  }
  const auto content = bytes.subspan(size_at, size_prefix + size);
  const auto* const header = aedat4::verified<aedat4::Header>(content, "IOHE");
  if (header == nullptr) throw UnsupportedFormat("the header of this AEDAT4 file is corrupt");
  if (header->compression() < 0 ||
      header->compression() > static_cast<int>(Aedat4Compression::zstd_high))
    throw UnsupportedFormat("this AEDAT4 file has an unknown compression, number " +
                            std::to_string(header->compression()));
  compression_ = static_cast<Aedat4Compression>(header->compression());
  if (const auto xml = aedat4::elements_of(header->info_node()); xml.count > 0) {
    auto info = read_info_node({reinterpret_cast<const char*>(xml.data), xml.count});
    if (!info.whole) corruption_.note(size_at, "the header's XML is corrupt");
    streams_ = std::move(info.streams);
    listed_ = info.whole && !streams_.empty();
  }
  packets_at_ = before + size;
  if (header->data_table_position() >= static_cast<std::int64_t>(packets_at_)) {
    table_at_ = static_cast<std::uint64_t>(header->data_table_position());
    const auto* const field = reinterpret_cast<const flatbuffers::Table*>(header)->GetAddressOf(
        aedat4::Header::VT_DATA_TABLE_POSITION);
    table_field_at_ = size_at + static_cast<std::uint64_t>(field - content.data());
  }
  queue_.consume(before + size);
  read_table();
  return true;
}

bool Aedat4Decoder::open(ByteSource& source) {
  source_ = &source;
  return false;
}

void Aedat4Decoder::read_table() {
  // Larger tables, of recordings of many days, are not read.
  constexpr std::uint64_t max_table = std::uint64_t{1} << 26;
  if (source_ == nullptr || !table_at_) return;
  std::vector<std::uint8_t> bytes;
  const auto size = source_->size();
  if (size > *table_at_ && size - *table_at_ <= max_table) bytes.resize(size - *table_at_);
  if (!bytes.empty() && source_->read(*table_at_, bytes) != bytes.size()) bytes.clear();
  auto table = read_aedat4_table(bytes, compression_, packets_at_);
  table_missing_ = !table;
  if (table && !std::ranges::all_of(*table, is_blank)) table_ = std::move(*table);
}

/// A missing table is reported after all other corruption, which may be its cause.
void Aedat4Decoder::note_missing_table() {
  if (!table_missing_ || std::exchange(table_reported_, true)) return;
  const auto at = table_at_.value_or(0);
  if (table_found_at_ && *table_found_at_ != at)
    corruption_.note(table_field_at_, "the header has a wrong position for the packet table");
  else if (source_->size() <= at)
    corruption_.note(source_->size(), "the file ends before its packet table");
  else
    corruption_.note(at, "the packet table that the header states is missing");
}

std::optional<SeekPoint> Aedat4Decoder::seek_point_before(Microseconds t) const {
  if (!header_read()) return std::nullopt;
  const bool from_start = table_.empty() || t == std::numeric_limits<Microseconds>::min();
  return SeekPoint{
      .t = t,
      .position = from_start ? packets_at_ : aedat4_position_of(table_, t).value_or(*table_at_)};
}

std::optional<Microseconds> Aedat4Decoder::last_time() {
  std::optional<Microseconds> last;
  for (const auto& entry : table_) {
    const auto stream = stream_of(entry.stream);
    if (!stream || entry.end >= Chunker::max_time) continue;
    const auto kind = streams_[*stream].kind;
    if (kind == StreamKind::events || kind == StreamKind::frames)
      last = std::max(last.value_or(entry.end), entry.end);
  }
  return last;
}

bool Aedat4Decoder::is_empty(std::size_t stream) const {
  return !table_.empty() && std::ranges::none_of(table_, [&](const Aedat4TableEntry& entry) {
    return entry.stream == streams_[stream].id;
  });
}

Aedat4Decoder::Place Aedat4Decoder::place_at(std::size_t offset) {
  const auto count = std::min(queue_.size(), offset + packet_head);
  const auto bytes = queue_.peek(count).subspan(offset, count - offset);
  if (bytes.size() < packet_head) {
    if (!finished_) return Place::more;
    if (bytes.empty()) return Place::end;
  } else {
    if (begins_packet(bytes)) return Place::packet;
    const auto* const identifier = bytes.data() + identifier_at;
    if (std::equal(identifier, identifier + identifier_size, "FTAB")) return Place::table;
    if (compression_ != Aedat4Compression::none && begins_frame(codec_of(compression_), bytes))
      return Place::table;
  }
  return table_at_ == queue_.position() + offset ? Place::table : Place::noise;
}

bool Aedat4Decoder::begins_packet(std::span<const std::uint8_t> bytes) const {
  const auto id = little_endian<std::int32_t>(bytes.data());
  const auto size = little_endian<std::uint32_t>(bytes.data() + 4);
  if (size < payload_head || size > aedat4_max_packet) return false;
  if (listed_ ? !stream_of(id) : id < 0 || id >= max_unlisted_streams) return false;
  const auto payload = bytes.subspan(aedat4_packet_header);
  if (compression_ != Aedat4Compression::none) return begins_frame(codec_of(compression_), payload);
  if (little_endian<std::uint32_t>(payload.data()) > size - size_prefix) return false;
  const auto identifier = payload.subspan(identifier_at, identifier_size);
  return std::all_of(identifier.begin(), identifier.end(), [](std::uint8_t c) {
    return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  });
}

bool Aedat4Decoder::scan() {
  while (true) {
    const auto place = place_at(0);
    if (place == Place::more || place == Place::end) return false;
    if (place == Place::packet) break;
    queue_.consume(1);
  }
  scanning_ = false;
  return true;
}

bool Aedat4Decoder::read_packet() {
  const auto place = place_at(0);
  if (place == Place::more || place == Place::end) return false;
  if (place != Place::packet) {
    // The table follows the last packet, but search for further packets all the same.
    if (place == Place::noise)
      corruption_.note(queue_.position(), "bytes that are not a packet");
    else if (!table_found_at_)
      table_found_at_ = queue_.position();
    queue_.consume(1);
    scanning_ = true;
    return true;
  }
  const auto head = queue_.peek(packet_head);
  const auto id = little_endian<std::int32_t>(head.data());
  const std::size_t size = little_endian<std::uint32_t>(head.data() + 4);
  const auto prefix = little_endian<std::uint32_t>(head.data() + aedat4_packet_header);
  const auto packet = aedat4_packet_header + size;
  auto bytes = queue_.peek(packet);
  if (bytes.empty()) {
    if (!finished_) return false;
    corruption_.note(queue_.position(), "a packet truncated by the end of the file");
    queue_.consume(aedat4_packet_header);
    scanning_ = true;
    return true;
  }

  std::span<const std::uint8_t> content;
  std::size_t used = 0;
  if (compression_ != Aedat4Compression::none) {
    const auto decompressed = decompressor_.decompress(
        codec_of(compression_), bytes.subspan(aedat4_packet_header, size), aedat4_max_packet);
    if (decompressed) {
      content = decompressed->bytes;
      used = decompressed->used;
    }
  } else {
    used = size_prefix + prefix;
  }
  // A corrupt size swallows packets or ends within one, which shows in what follows. Without
  // compression, missing bytes show in no other way.
  bool sound_after = true;
  if (used != size || compression_ == Aedat4Compression::none) {
    const auto after = place_at(packet);
    if (after == Place::more) return false;
    sound_after = after != Place::noise;
    bytes = queue_.peek(packet);
  }
  if (compression_ == Aedat4Compression::none)
    content = bytes.subspan(aedat4_packet_header, used);
  else if (used != 0 && content.size() >= payload_head)
    content = content.first(std::min(
        content.size(), size_prefix + std::size_t{little_endian<std::uint32_t>(content.data())}));

  const char* corruption = nullptr;
  if (used == 0)
    corruption = "a packet that does not decompress";
  else if (compression_ == Aedat4Compression::none && !sound_after &&
           !has_sound_events(content, id))
    corruption = "a packet with missing bytes";
  else
    corruption = read_content(content, id);
  if (corruption == nullptr) {
    packet_ = packet;
    if (!sound_after && used != size) {
      packet_ = aedat4_packet_header + used;
      corruption_.note(queue_.position(), "a packet of the wrong size");
      scanning_ = true;
    }
    credit_ = std::min(max_credit, credit_ + packet);
    return true;
  }
  if (used == size && compression_ != Aedat4Compression::none) {
    const auto after = place_at(packet);
    if (after == Place::more) return false;
    sound_after = after != Place::noise;
  }
  corruption_.note(queue_.position(), corruption);
  // A packet that decompresses contains no further packets.
  const auto sound = compression_ == Aedat4Compression::none ? 0 : used;
  skip_corrupt(packet, sound, size + (used == 0 ? decompressing : content.size()), sound_after);
  return true;
}

/// Skips a corrupt packet of `packet` bytes if it is followed by something valid, else searches it
/// for packets that it has swallowed.
void Aedat4Decoder::skip_corrupt(std::size_t packet, std::size_t sound, std::size_t work,
                                 bool sound_after) {
  if (sound_after) {
    queue_.consume(packet);
    return;
  }
  scanning_ = true;
  const bool affordable = work <= credit_;
  if (affordable) credit_ -= work;
  queue_.consume(affordable ? aedat4_packet_header + sound : packet);
}

/// Reads the content of a packet. Returns a description of its corruption, or nullptr.
const char* Aedat4Decoder::read_content(std::span<const std::uint8_t> content, int id) {
  if (content.size() < payload_head) return broken_packet;
  const auto kind =
      aedat4_kind({reinterpret_cast<const char*>(content.data()) + identifier_at, identifier_size});
  const auto stream = stream_of(id);
  if (stream && streams_[*stream].kind != kind)
    return "a packet of a different kind than its stream";
  if (kind == StreamKind::other) return nullptr;
  std::optional<aedat4::Elements> elements = aedat4::Elements{};
  if (kind == StreamKind::frames) {
    if (const char* const corruption = read_frame(content)) return corruption;
  } else if (kind == StreamKind::events) {
    elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
  } else if (kind == StreamKind::triggers) {
    elements = aedat4::verified_elements<aedat4::Tables<aedat4::Trigger>>(content, "TRIG");
  } else {
    elements = aedat4::verified_elements<aedat4::Tables<aedat4::Imu>>(content, "IMUS");
  }
  if (!elements) return broken_packet;
  elements_ = {kind, elements->data, elements->count, stream ? *stream : add_stream(id, kind)};
  if (frame_) frame_->stream = elements_.stream;
  return nullptr;
}

const char* Aedat4Decoder::read_frame(std::span<const std::uint8_t> content) {
  const auto* const packet = aedat4::verified<aedat4::Frame>(content, "FRME");
  if (packet == nullptr) return broken_packet;
  const auto format = static_cast<PixelFormat>(packet->format());
  const auto pixel = bytes_per_pixel(format);
  if (pixel == 0) return nullptr;  // an unknown format
  const auto pixels = aedat4::elements_of(packet->pixels());
  if (packet->width() <= 0 || packet->height() <= 0 ||
      pixels.count != std::size_t{1} * packet->width() * packet->height() * pixel)
    return "a frame whose payload does not match its dimensions";
  for (const auto t : {packet->t(), packet->begin_t(), packet->end_t(), packet->exposure_begin_t(),
                       packet->exposure_end_t(), packet->exposure()})
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
  if (frame.begin == 0 && frame.end == 0 && frame.exposure_begin == 0 && frame.exposure_end == 0) {
    frame.begin = frame.exposure_begin = frame.t;
    frame.end = frame.exposure_end = frame.t + packet->exposure();
  }
  frame_ = FrameItem{0, frame};
  return nullptr;
}

/// True if all events of a packet are valid and in order, and for all other packets.
bool Aedat4Decoder::has_sound_events(std::span<const std::uint8_t> content, int id) const {
  const auto elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
  const auto stream = stream_of(id);
  if (!elements || !stream) return true;
  const auto limit = limit_of(streams_[*stream].size);
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

Item Aedat4Decoder::next_elements() {
  if (elements_.kind == StreamKind::events) return next_events();
  if (elements_.kind == StreamKind::triggers) {
    read_tables(trigger_of, "a trigger at an impossible time", triggers_);
    return TriggerItem{elements_.stream, triggers_};
  }
  read_tables(imu_sample_of, "an IMU sample at an impossible time", imu_samples_);
  return ImuItem{elements_.stream, imu_samples_};
}

Item Aedat4Decoder::next_events() {
  const auto count = std::min(elements_.count, block);
  const EventItem item{elements_.stream, checked_events(count)};
  elements_.data += count * event_size;
  elements_.count -= count;
  return item;
}

/// Returns the next `count` events without invalid ones. A valid block takes a single pass.
std::span<const AbsoluteEvent> Aedat4Decoder::checked_events(std::size_t count) {
  const auto limit = limit_of(streams_[elements_.stream].size);
  const auto width = limit.width;
  const auto height = limit.height;
  const auto* const from = elements_.data;
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
      corruption_.note(queue_.position(), "an event at an impossible time");
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
void Aedat4Decoder::read_tables(Element (*element_of)(const Table&), const char* corruption,
                                std::vector<Element>& out) {
  const auto count = std::min(elements_.count, block);
  const aedat4::Elements tables{elements_.data, count};
  out.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const table = tables.table<Table>(i);
    if (is_time(table->t()))
      out.push_back(element_of(*table));
    else
      corruption_.note(queue_.position(), corruption);
  }
  elements_.data += count * sizeof(flatbuffers::uoffset_t);
  elements_.count -= count;
}

std::optional<std::size_t> Aedat4Decoder::stream_of(int id) const {
  for (std::size_t i = 0; i < streams_.size(); ++i)
    if (streams_[i].id == id) return i;
  return std::nullopt;
}

/// Adds a stream that is not listed in the header.
std::size_t Aedat4Decoder::add_stream(int id, StreamKind kind) {
  streams_.push_back({id, kind, {}, {}});
  return streams_.size() - 1;
}

}  // namespace eventcamera
