// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string_view>

#include "src/formats/file_formats.hpp"

namespace eventcamera {

/// What a file is, by its first bytes, as GStreamer chooses among typefinders.
struct Recognised {
  std::string_view media_type;
  Likelihood likelihood = Likelihood::none;

  friend bool operator==(const Recognised&, const Recognised&) = default;
};

/// Without a media type if the format is unknown.
inline Recognised recognise(std::span<const std::uint8_t> start) {
  Recognised best;
  for (const auto& format : file_formats()) {
    const auto found = likelihood(format, start);
    if (found > best.likelihood) best = {format.media_type, found};
  }
  return best;
}

}  // namespace eventcamera
