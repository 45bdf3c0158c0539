// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_decoder.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "src/core/byte_order.hpp"
#include "src/formats/aedat/aedat4_flatbuffer.hpp"
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
/// Searching a packet with a corrupt size for the next one repeats work. This bounds that work in
/// malicious files, in bytes.
constexpr std::size_t max_credit = std::size_t{256} << 20;
/// Work charged for a failed decompression, besides the packet's bytes.
constexpr std::size_t decompressing = std::size_t{4} << 20;

/// True for the entries of older versions of DV, which state neither times nor counts.
bool is_blank(const Aedat4TableEntry& entry) {
  return entry.elements == 0 && entry.start == 0 && entry.end == 0;
}

}  // namespace

Aedat4Decoder::Aedat4Decoder() : credit_(max_credit) {}

void Aedat4Decoder::push(std::span<const std::uint8_t> piece) {
  if (packet_ != 0) throw std::logic_error("Aedat4Decoder::push() before next() returned nothing");
  queue_.push(piece);
}

std::optional<Item> Aedat4Decoder::next() {
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

void Aedat4Decoder::resume(std::uint64_t position) {
  queue_.restart(position);
  elements_.clear();
  packet_ = 0;
  finished_ = false;
  scanning_ = false;
  table_reported_ = false;
}

bool Aedat4Decoder::read_header() {
  const auto known = std::min(queue_.size(), aedat4_magic.size());
  const auto start = queue_.peek(known).first(known);
  if (!std::equal(start.begin(), start.end(), aedat4_magic.begin()))
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
  handle_header(bytes.subspan(size_at, size_prefix + size));
  queue_.consume(packets_at_);
  read_table();
  return true;
}

/// Evaluates the FlatBuffer of the header.
void Aedat4Decoder::handle_header(std::span<const std::uint8_t> content) {
  const auto at = aedat4_magic.size();
  const auto* const header = aedat4::verified<aedat4::Header>(content, "IOHE");
  if (header == nullptr) throw UnsupportedFormat("the header of this AEDAT4 file is corrupt");
  if (header->compression() < 0 ||
      header->compression() > static_cast<int>(Aedat4Compression::zstd_high))
    throw UnsupportedFormat("this AEDAT4 file has an unknown compression, number " +
                            std::to_string(header->compression()));
  compression_ = static_cast<Aedat4Compression>(header->compression());
  if (const auto xml = aedat4::elements_of(header->info_node()); xml.count > 0) {
    auto info = read_info_node({reinterpret_cast<const char*>(xml.data), xml.count});
    if (!info.whole) corruption_.note(at, "the header's XML is corrupt");
    streams_ = std::move(info.streams);
    listed_ = info.whole && !streams_.empty();
  }
  packets_at_ = at + content.size();
  if (header->data_table_position() >= static_cast<std::int64_t>(packets_at_)) {
    table_at_ = static_cast<std::uint64_t>(header->data_table_position());
    const auto* const field = reinterpret_cast<const flatbuffers::Table*>(header)->GetAddressOf(
        aedat4::Header::VT_DATA_TABLE_POSITION);
    table_field_at_ = at + static_cast<std::uint64_t>(field - content.data());
  }
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
  for (const auto& stream : streams_) {
    const auto extent = extents_.find(stream.id);
    if (extent == extents_.end()) continue;
    if (stream.kind == StreamKind::events || stream.kind == StreamKind::frames)
      last = std::max(last, extent->second.last);  // none is the minimum
  }
  return last;
}

std::optional<std::uint64_t> Aedat4Decoder::end_of(std::size_t stream, Microseconds t) const {
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
    if (is_compressed() && begins_frame(codec_of(compression_), bytes)) return Place::table;
  }
  return table_at_ == queue_.position() + offset ? Place::table : Place::noise;
}

bool Aedat4Decoder::begins_packet(std::span<const std::uint8_t> bytes) const {
  const auto id = little_endian<std::int32_t>(bytes.data());
  const auto size = little_endian<std::uint32_t>(bytes.data() + 4);
  if (size < payload_head || size > aedat4_max_packet) return false;
  if (!may_have_stream(id)) return false;
  const auto payload = bytes.subspan(aedat4_packet_header);
  if (is_compressed()) return begins_frame(codec_of(compression_), payload);
  if (little_endian<std::uint32_t>(payload.data()) > size - size_prefix) return false;
  const auto identifier = payload.subspan(identifier_at, identifier_size);
  return std::all_of(identifier.begin(), identifier.end(), [](std::uint8_t c) {
    return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  });
}

bool Aedat4Decoder::may_have_stream(int id) const {
  return listed_ ? stream_of(id).has_value() : id >= 0 && id < max_unlisted_streams;
}

/// Moves on to the next packet. False if more bytes are needed.
bool Aedat4Decoder::find_packet() {
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
bool Aedat4Decoder::read_packet() {
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
  // A corrupt size swallows packets or ends within one, which shows in what follows. Without
  // compression, missing bytes show in no other way.
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

Aedat4Decoder::Payload Aedat4Decoder::unpacked(std::span<const std::uint8_t> payload) {
  const auto flatbuffer_size = [](std::span<const std::uint8_t> bytes) {
    return size_prefix + little_endian<std::uint32_t>(bytes.data());
  };
  if (!is_compressed()) {
    const auto used = flatbuffer_size(payload);
    return {payload.first(used), used};
  }
  const auto decompressed =
      decompressor_.decompress(codec_of(compression_), payload, aedat4_max_packet);
  if (!decompressed) return {};
  auto content = decompressed->bytes;
  if (content.size() >= payload_head)
    content = content.first(std::min(content.size(), flatbuffer_size(content)));
  return {content, decompressed->used};
}

/// Skips a corrupt packet if it is followed by something valid, else searches it for packets that
/// it has swallowed.
void Aedat4Decoder::skip_corrupt(const Payload& payload, std::size_t size, Place after) {
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

/// Reads the payload of a packet, which `after` follows. Returns a description of its corruption,
/// or nullptr.
const char* Aedat4Decoder::read_content(const Payload& payload, int id, Place after) {
  const auto content = payload.content;
  if (payload.used == 0) return "a packet that does not decompress";
  if (content.size() < payload_head) return Aedat4Elements::broken_packet;
  const auto kind =
      aedat4_kind({reinterpret_cast<const char*>(content.data()) + identifier_at, identifier_size});
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

std::optional<std::size_t> Aedat4Decoder::stream_of(int id) const {
  for (std::size_t i = 0; i < streams_.size(); ++i)
    if (streams_[i].id == id) return i;
  return std::nullopt;
}

}  // namespace eventcamera
