// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "src/measure/event_statistics.hpp"

namespace eventcamera {

/// A picture in 24-bit RGB.
struct RgbPicture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels{};

  /// Writes a PNG. Throws std::runtime_error, which says why it cannot.
  void write_png(const std::string& path) const;
};

/// The events of each pixel from black, none, to light yellow: as many as all but one in two
/// hundred of the pixels that have any. Throws std::bad_alloc.
RgbPicture draw_map(const EventMap& map);

/// Side by side, in one scale: the reference, the candidate, and in blue where the candidate has
/// more events, in red where it has fewer. Throws std::bad_alloc.
RgbPicture draw_maps(const EventMap& reference, const EventMap& candidate);

}  // namespace eventcamera
