// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <stdexcept>

namespace eventcamera {

/// Thrown if the bytes are not of this format, or of an unsupported version or codec. what() is a
/// message for users.
class UnsupportedFormat : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace eventcamera
