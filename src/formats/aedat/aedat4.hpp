// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "src/core/event.hpp"
#include "src/formats/reader.hpp"

namespace eventcamera {

/// How each packet of an AEDAT4 file is compressed; the numbers are the file's.
enum class Aedat4Compression : std::uint8_t {
  none = 0,
  lz4 = 1,
  lz4_high = 2,
  zstd = 3,
  zstd_high = 4,
};

/// The file's first line.
constexpr std::string_view aedat4_magic = "#!AER-DAT4.0\r\n";

/// The bytes before a packet's payload: the stream's id and the payload's size.
constexpr std::size_t aedat4_packet_header = 8;

/// The largest payload, and the largest content of one, that is read. An uncompressed colour frame
/// of 4096x2304 pixels fits.
constexpr std::size_t aedat4_largest_packet = std::size_t{64} << 20;

/// Times further from zero than this are corruption: 36,000 years.
constexpr Microseconds aedat4_last_time = Microseconds{1} << 60;

}  // namespace eventcamera
