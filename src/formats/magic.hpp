// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace eventcamera {

/// True if the characters of `magic` are at a position of `bytes`.
inline bool has_at(std::size_t at, std::string_view magic, std::span<const std::uint8_t> bytes) {
  return bytes.size() >= at && bytes.size() - at >= magic.size() &&
         std::ranges::equal(bytes.subspan(at, magic.size()), magic, {},
                            [](std::uint8_t byte) { return static_cast<char>(byte); });
}

/// First bytes of bags; an MCAP file ends with them, too.
inline constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);
inline constexpr std::string_view rosbag_magic = "#ROSBAG V2.0\n";
inline constexpr std::string_view sqlite_magic("SQLite format 3\0", 16);

}  // namespace eventcamera
