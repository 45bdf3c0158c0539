// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_table.hpp"

#include <algorithm>

#include "src/core/byte_order.hpp"
#include "src/formats/aedat/aedat4.hpp"
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
constexpr const char* identifier = "FTAB";

}  // namespace

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
      aedat4::verified_elements<aedat4::Tables<aedat4::TableEntry>>(content, identifier);
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
  builder.FinishSizePrefixed(aedat4::CreateFileTableDirect(builder, &entries), identifier);
  return {builder.GetBufferPointer(), builder.GetBufferPointer() + builder.GetSize()};
}

}  // namespace eventcamera
