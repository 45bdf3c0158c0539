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

}  // namespace eventcamera
