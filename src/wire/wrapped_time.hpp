// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "src/core/event.hpp"

namespace eventcamera {

/// Unwraps 32-bit times in microseconds: each is assumed to be less than half the range (36
/// minutes) from the expected time.
class WrappedTime {
 public:
  Microseconds at(std::uint32_t t) {
    if (!expected_) {
      expected_ = t;
    } else {
      *expected_ += static_cast<std::int32_t>(t - static_cast<std::uint32_t>(*expected_));
    }
    return *expected_;
  }

  /// Advances the expected time.
  void pass(Microseconds time) {
    if (expected_) *expected_ += time;
  }

 private:
  std::optional<Microseconds> expected_;
};

}  // namespace eventcamera
