// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace eventcamera {

/// The two streams of a comparison.
enum class Side : std::uint8_t { reference, candidate };

inline constexpr std::array both_sides = {Side::reference, Side::candidate};

constexpr Side other(Side side) {
  return side == Side::reference ? Side::candidate : Side::reference;
}

/// Something of which each side has one.
template <class Type>
class OfSides {
 public:
  OfSides() = default;
  OfSides(const Type& reference, const Type& candidate) : both_{reference, candidate} {}

  Type& operator[](Side side) { return both_[static_cast<std::size_t>(side)]; }
  const Type& operator[](Side side) const { return both_[static_cast<std::size_t>(side)]; }

 private:
  std::array<Type, 2> both_{};
};

}  // namespace eventcamera
