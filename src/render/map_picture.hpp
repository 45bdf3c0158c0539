// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "src/core/image.hpp"

namespace eventcamera {

/// A picture in 24-bit RGB.
struct RgbPicture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels{};

  /// Writes a PNG. Throws std::runtime_error, which says why it cannot.
  void write_png(const std::string& path) const;
};

/// The events of each pixel from black, for none, to light yellow, for the 99.5 % quantile of the
/// pixels that have any. Throws std::bad_alloc.
RgbPicture draw_map(const Image<std::uint32_t>& map);

/// The reference, the candidate and their difference, next to each other and in one scale: blue
/// where the candidate has more events, red where it has fewer. Throws std::bad_alloc.
RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate);

}  // namespace eventcamera
