// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <pugixml.hpp>
#include <sstream>

#include "src/core/byte_order.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat4_flatbuffer.hpp"

namespace eventcamera {

namespace {

/// Large enough for recordings of a day.
constexpr std::size_t max_table = std::size_t{512} << 20;
/// Tables compress to a fifth at best, even for evenly spaced packets; anything that grows more is
/// not a table.
constexpr std::size_t max_growth = 16;
/// Minimum size of an entry, so that entries that share bytes cannot exhaust the memory.
constexpr std::size_t min_entry = 24;
constexpr const char* table_identifier = "FTAB";

constexpr std::size_t max_streams = 256;

/// Keeps text as it was written, and expands no entities but the five of XML.
constexpr unsigned parse_options =
    pugi::parse_escapes | pugi::parse_cdata | pugi::parse_ws_pcdata_single;

std::optional<int> number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

const char* value_of(const pugi::xml_node& node, const char* key) {
  return node.find_child_by_attribute("attr", "key", key).child_value();
}

SensorSize size_of(const pugi::xml_node& info) {
  const auto width = number(value_of(info, "sizeX")).value_or(0);
  const auto height = number(value_of(info, "sizeY")).value_or(0);
  return is_side(width) && is_side(height) ? SensorSize{width, height} : SensorSize{};
}

pugi::xml_node add_node(pugi::xml_node parent, const std::string& name, const std::string& path) {
  auto node = parent.append_child("node");
  node.append_attribute("name") = name.c_str();
  node.append_attribute("path") = path.c_str();
  return node;
}

void add_value(pugi::xml_node node, const char* key, const std::string& value,
               const char* type = "string") {
  auto attribute = node.append_child("attr");
  attribute.append_attribute("key") = key;
  attribute.append_attribute("type") = type;
  attribute.text() = value.c_str();
}

/// Indexed by Aedat4Compression.
constexpr const char* compression_names[] = {"NONE", "LZ4", "LZ4_HIGH", "ZSTD", "ZSTD_HIGH"};

struct KindText {
  StreamKind kind;
  std::string_view identifier;
  const char* name;
  const char* description;
};

constexpr std::array<KindText, 4> kinds{{
    {StreamKind::events, "EVTS", "events", "Array of events (polarity ON/OFF)."},
    {StreamKind::frames, "FRME", "frames", "Standard frame (8-bit image)."},
    {StreamKind::triggers, "TRIG", "triggers", "External triggers and special signals."},
    {StreamKind::imu, "IMUS", "imu", "Inertial Measurement Unit data samples."},
}};

/// Reads the nodes outInfo/N and outInfo/N/info.
void read_info_node(std::string_view xml, Aedat4Header& header) {
  pugi::xml_document document;
  // Keeps what precedes an error.
  header.lists_streams =
      document.load_buffer(xml.data(), xml.size(), parse_options, pugi::encoding_utf8);
  const auto out_info = document.find_node([](const pugi::xml_node& node) {
    return std::string_view(node.attribute("name").value()) == "outInfo";
  });
  auto& streams = header.streams;
  for (const auto& stream : out_info.children("node")) {
    const auto id = number(stream.attribute("name").value());
    if (!id) continue;
    if (streams.size() == max_streams ||
        std::ranges::find(streams, *id, &StreamInfo::id) != streams.end()) {
      header.lists_streams = false;
      break;
    }
    const auto kind = aedat4_kind(value_of(stream, "typeIdentifier"));
    // The error precedes its kind.
    if (!header.lists_streams && kind == StreamKind::other) continue;
    const auto details = stream.find_child_by_attribute("node", "name", "info");
    streams.push_back({*id, kind, size_of(details), value_of(details, "source")});
  }
}

}  // namespace

StreamKind aedat4_kind(std::string_view identifier) {
  const auto* const text = std::ranges::find(kinds, identifier, &KindText::identifier);
  return text != kinds.end() ? text->kind : StreamKind::other;
}

std::optional<Aedat4Header> read_aedat4_header(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t max_header = std::size_t{16} << 20;
  constexpr auto size_at = aedat4_magic.size();
  const auto known = std::min(bytes.size(), size_at);
  if (!std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(known),
                  aedat4_magic.begin()))
    throw UnsupportedFormat("this is not AEDAT4: it does not begin with " +
                            std::string(aedat4_magic.substr(0, size_at - 2)));
  if (bytes.size() < size_at + aedat4::size_prefix) return std::nullopt;
  const auto size = little_endian<std::uint32_t>(bytes.data() + size_at);
  if (size > max_header)
    throw UnsupportedFormat("this AEDAT4 file claims a header of " + std::to_string(size) +
                            " bytes");
  if (bytes.size() - size_at - aedat4::size_prefix < size) return std::nullopt;
  const auto content = bytes.subspan(size_at, aedat4::size_prefix + size);
  const auto* const root = aedat4::verified<aedat4::Header>(content, "IOHE");
  if (root == nullptr) throw UnsupportedFormat("the header of this AEDAT4 file is corrupt");
  if (root->compression() < 0 ||
      root->compression() > static_cast<int>(Aedat4Compression::zstd_high))
    throw UnsupportedFormat("this AEDAT4 file has an unknown compression, number " +
                            std::to_string(root->compression()));
  Aedat4Header header;
  header.compression = static_cast<Aedat4Compression>(root->compression());
  if (const auto xml = aedat4::elements_of(root->info_node()); xml.count > 0)
    read_info_node({reinterpret_cast<const char*>(xml.data), xml.count}, header);
  header.packets_at = size_at + content.size();
  if (root->data_table_position() >= static_cast<std::int64_t>(header.packets_at)) {
    header.table_at = static_cast<std::uint64_t>(root->data_table_position());
    const auto* const field = reinterpret_cast<const flatbuffers::Table*>(root)->GetAddressOf(
        aedat4::Header::VT_DATA_TABLE_POSITION);
    header.table_field_at = size_at + static_cast<std::uint64_t>(field - content.data());
  }
  return header;
}

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression) {
  const std::string path = "/mainloop/Recorder/outInfo/";
  pugi::xml_document document;
  auto root = document.append_child("dv");
  root.append_attribute("version") = "2.0";
  const auto out_info = add_node(root, "outInfo", path);
  for (const auto& stream : streams) {
    const auto* const text = std::ranges::find(kinds, stream.kind, &KindText::kind);
    if (text == kinds.end()) continue;
    const auto id = std::to_string(stream.id);
    const auto node = add_node(out_info, id, path + id + "/");
    add_value(node, "compression", compression_names[static_cast<int>(compression)]);
    add_value(node, "originalModuleName", "gst-eventsim");
    add_value(node, "originalOutputName", text->name);
    add_value(node, "typeDescription", text->description);
    add_value(node, "typeIdentifier", std::string(text->identifier));
    const auto info = add_node(node, "info", path + id + "/info/");
    add_value(info, "sizeX", std::to_string(stream.size.width), "int");
    add_value(info, "sizeY", std::to_string(stream.size.height), "int");
    add_value(info, "source", stream.source);
  }
  std::ostringstream text;
  root.print(text, "", pugi::format_raw);
  return text.str();
}

std::optional<std::vector<Aedat4TableEntry>> read_aedat4_table(std::span<const std::uint8_t> bytes,
                                                               Aedat4Compression compression,
                                                               std::uint64_t packets_at) {
  if (bytes.size() > max_table) return std::nullopt;
  FrameDecompressor decompressor;
  auto content = bytes;
  if (compression != Aedat4Compression::none && begins_frame(codec_of(compression), bytes)) {
    const auto decompressed = decompressor.decompress(
        codec_of(compression), bytes, std::min(max_table, max_growth * bytes.size()));
    if (!decompressed) return std::nullopt;
    content = decompressed->bytes;
  }
  const auto entries =
      aedat4::verified_elements<aedat4::Tables<aedat4::TableEntry>>(content, table_identifier);
  if (!entries || entries->count > content.size() / min_entry) return std::nullopt;

  const auto first = static_cast<std::int64_t>(packets_at);
  bool of_headers = false;
  for (std::size_t i = 0; i < entries->count; ++i)
    of_headers |= entries->table<aedat4::TableEntry>(i)->byte_offset() == first;
  const auto before = static_cast<std::int64_t>(of_headers ? 0 : aedat4_packet_header);
  std::vector<Aedat4TableEntry> table;
  for (std::size_t i = 0; i < entries->count; ++i) {
    const auto* const entry = entries->table<aedat4::TableEntry>(i);
    const auto* const packet = reinterpret_cast<const std::uint8_t*>(entry->packet_info());
    if (packet == nullptr || entry->byte_offset() < first + before) continue;
    const auto stream = little_endian<std::int32_t>(packet);
    const auto size = little_endian<std::int32_t>(packet + sizeof stream);
    if (size < 0) continue;
    table.push_back({static_cast<std::uint64_t>(entry->byte_offset() - before), stream, size,
                     entry->num_elements(), entry->timestamp_start(), entry->timestamp_end()});
  }
  return table;
}

std::optional<std::uint64_t> aedat4_position_of(std::span<const Aedat4TableEntry> table,
                                                Microseconds t) {
  std::optional<std::uint64_t> position;
  for (const auto& entry : table)
    if (entry.end >= t && (!position || entry.position < *position)) position = entry.position;
  return position;
}

std::vector<std::uint8_t> aedat4_table_content(std::span<const Aedat4TableEntry> table) {
  flatbuffers::FlatBufferBuilder builder;
  std::vector<flatbuffers::Offset<aedat4::TableEntry>> entries;
  entries.reserve(table.size());
  for (const auto& entry : table) {
    const aedat4::PacketInfo packet(entry.stream, entry.size);
    entries.push_back(aedat4::CreateTableEntry(
        builder, static_cast<std::int64_t>(entry.position + aedat4_packet_header), &packet,
        entry.elements, entry.start, entry.end));
  }
  builder.FinishSizePrefixed(aedat4::CreateFileTableDirect(builder, &entries), table_identifier);
  return {builder.GetBufferPointer(), builder.GetBufferPointer() + builder.GetSize()};
}

}  // namespace eventcamera
