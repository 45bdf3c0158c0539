// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace eventcamera {

/// First bytes of bags; an MCAP file ends with them, too.
inline constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);
inline constexpr std::string_view rosbag_magic = "#ROSBAG V2.0\n";
inline constexpr std::string_view sqlite_magic("SQLite format 3\0", 16);

}  // namespace eventcamera
