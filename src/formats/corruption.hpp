// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace eventcamera {

/// Thrown if the bytes are not of this format, or of an unsupported version or codec. what() is a
/// message for users.
class UnsupportedFormat : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Corruption found so far. A decoder skips it and continues at the next valid place.
struct Corruption {
  std::uint64_t places = 0;    ///< number of corrupt places
  std::uint64_t first_at = 0;  ///< byte offset of the first in the file
  std::string first;           ///< description of the first, for users
  std::uint64_t last_at = 0;   ///< byte offset of the last that was found
  std::uint64_t outside = 0;   ///< events outside the sensor, dropped
  std::uint64_t skipped = 0;   ///< valid items that are no pixel events, such as exposures

  /// Records one more place.
  void note(std::uint64_t at, const char* what) {
    if (places++ == 0) {
      first_at = at;
      first = what;
    }
    last_at = at;
  }
};

}  // namespace eventcamera
