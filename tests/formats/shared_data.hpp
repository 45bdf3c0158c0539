// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace eventcamera::shared_data {

/// Recording in the shared data folder; empty if that is missing.
inline std::vector<std::uint8_t> events_file(const std::string& name) {
  const char* const folder = std::getenv("SHARED_DATA");
  std::ifstream file(std::string(folder != nullptr ? folder : "../shared/data") + "/events/" + name,
                     std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace eventcamera::shared_data
