// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Compression of the packets of an AEDAT4 file; the values are those in the file.
enum class Aedat4Compression : std::uint8_t {
  none = 0,
  lz4 = 1,
  lz4_high = 2,
  zstd = 3,
  zstd_high = 4,
};

/// Codec of compressed packets; `compression` must not be `none`.
constexpr FrameCodec codec_of(Aedat4Compression compression) {
  const bool is_lz4 =
      compression == Aedat4Compression::lz4 || compression == Aedat4Compression::lz4_high;
  return is_lz4 ? FrameCodec::lz4 : FrameCodec::zstd;
}

constexpr std::string_view aedat4_magic = "#!AER-DAT4.0\r\n";

/// Meaning of a trigger's source, a number in the file: input and direction of the edge.
struct Aedat4Edge {
  std::uint16_t id;
  bool rising;

  friend constexpr bool operator==(const Aedat4Edge&, const Aedat4Edge&) = default;
};
inline constexpr std::array<Aedat4Edge, 10> aedat4_edges{{{4, true},
                                                          {0, true},
                                                          {0, false},
                                                          {5, true},
                                                          {1, true},
                                                          {1, false},
                                                          {2, true},
                                                          {2, false},
                                                          {3, true},
                                                          {3, false}}};

/// Size of the packet header: stream ID and payload size.
constexpr std::size_t aedat4_packet_header = 8;

/// Size limit of payloads, compressed and decompressed. An uncompressed colour frame of 4096x2304
/// pixels fits.
constexpr std::size_t aedat4_max_packet = std::size_t{64} << 20;

/// Times beyond this, in either direction, are corrupt: 36,000 years.
constexpr Microseconds aedat4_last_time = Microseconds{1} << 60;

struct Aedat4Header {
  Aedat4Compression compression = Aedat4Compression::none;
  std::vector<StreamInfo> streams;
  bool lists_streams = true;              ///< false: its XML is corrupt, and `streams` incomplete
  std::uint64_t packets_at = 0;           ///< position of the first packet in the file
  std::optional<std::uint64_t> table_at;  ///< position of the packet table, if stated
  std::uint64_t table_field_at = 0;       ///< position of the field that states it
};

/// Parses the header at the start of a file; nothing if more bytes are needed. Throws
/// UnsupportedFormat.
std::optional<Aedat4Header> read_aedat4_header(std::span<const std::uint8_t> bytes);

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression);

/// Kind of streams whose packets have this four-character identifier.
StreamKind aedat4_kind(std::string_view identifier);

/// Entry for one packet in the table at the end of an AEDAT4 file.
struct Aedat4TableEntry {
  std::uint64_t position;  ///< of the packet header in the file
  int stream;              ///< stream ID
  int size;                ///< payload size
  std::int64_t elements;
  Microseconds start;  ///< time of its first element
  Microseconds end;    ///< time of its last element

  friend constexpr bool operator==(const Aedat4TableEntry&, const Aedat4TableEntry&) = default;
};

/// Parses the table in `bytes`, the end of the file from the table's position on; nothing if they
/// are not a table. The first packet is at `packets_at`. Positions point to packets or to their
/// payloads, depending on the writer; the first entry shows which.
std::optional<std::vector<Aedat4TableEntry>> read_aedat4_table(std::span<const std::uint8_t> bytes,
                                                               Aedat4Compression compression,
                                                               std::uint64_t packets_at);

/// Returns the position from which to read everything at `t` or later; nothing if there is none.
std::optional<std::uint64_t> aedat4_position_of(std::span<const Aedat4TableEntry> table,
                                                Microseconds t);

/// Serializes the table, before compression.
std::vector<std::uint8_t> aedat4_table_content(std::span<const Aedat4TableEntry> table);

/// Decodes AEDAT4: streams of events, frames, triggers and IMU samples. Bytes are passed in pieces
/// of any size; the split does not affect the result. A packet is the smallest unit that is read or
/// skipped.
///
/// The ID of a trigger is the source of the edge: 0 the camera's input, 1 its generator, 2 a frame,
/// 3 an exposure, 4 a reset of its clock, 5 a pulse at its input, 6 any other.
std::unique_ptr<Decoder> make_aedat4_decoder();

}  // namespace eventcamera
