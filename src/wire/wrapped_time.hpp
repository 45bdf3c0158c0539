// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "src/core/event.hpp"

namespace eventcamera {

/// Undoes the wraps of times of 32 bits, in microseconds: a time is taken to be less than half the
/// range (36 minutes) from where the clock was expected to be.
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

  /// Declares that time passed since the last one.
  void pass(Microseconds time) {
    if (expected_) *expected_ += time;
  }

 private:
  std::optional<Microseconds> expected_;
};

}  // namespace eventcamera
