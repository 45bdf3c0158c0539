// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <string>

#include "src/formats/byte_queue.hpp"

namespace eventcamera {

/// Longer lines of a text header are read, but only their beginning is kept.
constexpr std::size_t max_header_line = 4096;

/// Consumes bytes up to the end of a line and appends them to `line`, without CR and LF. False
/// while the end has not come.
inline bool take_header_line(ByteQueue& queue, std::string& line) {
  while (true) {
    const auto bytes = queue.peek(1);
    if (bytes.empty()) return false;
    const auto end = std::find(bytes.begin(), bytes.end(), '\n');
    const auto count = static_cast<std::size_t>(end - bytes.begin());
    line.append(reinterpret_cast<const char*>(bytes.data()),
                std::min(count, max_header_line - std::min(line.size(), max_header_line)));
    const bool ended = end != bytes.end();
    queue.consume(count + (ended ? 1 : 0));
    if (!ended) continue;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return true;
  }
}

}  // namespace eventcamera
