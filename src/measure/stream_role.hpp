// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace eventcamera {

/// The two streams of a comparison.
enum class StreamRole : std::uint8_t { reference, candidate };

inline constexpr std::array both_roles = {StreamRole::reference, StreamRole::candidate};

constexpr StreamRole other(StreamRole role) {
  return role == StreamRole::reference ? StreamRole::candidate : StreamRole::reference;
}

/// One value per stream.
template <class Type>
class PerRole {
 public:
  PerRole() = default;
  PerRole(Type reference, Type candidate) : both_{std::move(reference), std::move(candidate)} {}

  Type& operator[](StreamRole role) { return both_[static_cast<std::size_t>(role)]; }
  const Type& operator[](StreamRole role) const { return both_[static_cast<std::size_t>(role)]; }

 private:
  std::array<Type, 2> both_{};
};

}  // namespace eventcamera
