// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_table.hpp"

#include <algorithm>

#include "src/formats/aedat/aedat4.fbs.h"
#include "src/formats/aedat/aedat4_compression.hpp"

namespace eventcamera {

namespace {

/// A recording of a day fits.
constexpr std::size_t max_table = std::size_t{512} << 20;
constexpr std::size_t min_table = 12;
/// Even of evenly spaced packets a table shrinks to no less than a fifth; what grows more is none.
constexpr std::size_t max_growth = 16;
/// What an entry takes, so that those which share their bytes do not fill the memory.
constexpr std::size_t min_entry = 24;
constexpr const char* identifier = "FTAB";

}  // namespace

std::optional<std::vector<Aedat4TableEntry>> read_aedat4_table(std::span<const std::uint8_t> bytes,
                                                               Aedat4Compression compression,
                                                               std::uint64_t packets_at) {
  if (bytes.size() > max_table) return std::nullopt;
  Aedat4Decompressor decompressor;
  auto content = bytes;
  if (compression != Aedat4Compression::none && begins_compressed(compression, bytes)) {
    const auto decompressed =
        decompressor.decompress(compression, bytes, std::min(max_table, max_growth * bytes.size()));
    if (!decompressed) return std::nullopt;
    content = decompressed->bytes;
  } else {
    content = decompressor.aligned(bytes);
  }
  // The Verifier reads an identifier before it knows that there is room for one.
  if (content.size() < min_table) return std::nullopt;
  flatbuffers::Verifier::Options options;
  options.max_tables = static_cast<flatbuffers::uoffset_t>(content.size());
  flatbuffers::Verifier verifier(content.data(), content.size(), options);
  if (!verifier.VerifySizePrefixedBuffer<aedat4::FileTable>(identifier)) return std::nullopt;

  std::vector<Aedat4TableEntry> table;
  const auto* const entries =
      flatbuffers::GetSizePrefixedRoot<aedat4::FileTable>(content.data())->table();
  if (entries == nullptr) return table;
  if (entries->size() > content.size() / min_entry) return std::nullopt;
  const auto first = static_cast<std::int64_t>(packets_at);
  const bool of_headers = std::any_of(entries->begin(), entries->end(), [&](const auto* entry) {
    return entry->byte_offset() == first;
  });
  const auto before = static_cast<std::int64_t>(of_headers ? 0 : aedat4_packet_header);
  for (const auto* entry : *entries) {
    const auto* const packet = entry->packet_info();
    if (packet == nullptr || packet->size() < 0 || entry->byte_offset() < first + before) continue;
    table.push_back({static_cast<std::uint64_t>(entry->byte_offset() - before), packet->stream_id(),
                     packet->size(), entry->num_elements(), entry->timestamp_start(),
                     entry->timestamp_end()});
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
