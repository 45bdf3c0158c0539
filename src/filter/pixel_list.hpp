// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace eventcamera {

struct PixelPosition {
  std::uint16_t x;  ///< column, from the left
  std::uint16_t y;  ///< row, from the top

  friend constexpr bool operator==(const PixelPosition&, const PixelPosition&) = default;
};

/// Parses a list of pixels, one per line: column and row, separated by blanks or a comma. Empty
/// lines and lines that begin with # are skipped. Throws std::invalid_argument with the offending
/// line.
std::vector<PixelPosition> parse_pixel_list(std::string_view text);

/// Writes a list that parse_pixel_list() reads.
std::string pixel_list_text(const std::vector<PixelPosition>& pixels);

}  // namespace eventcamera
