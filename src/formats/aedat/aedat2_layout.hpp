// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// How the addresses of AEDAT 2.0 hold a pixel, which depends on the camera. Columns count from the
/// right and rows from the bottom.
struct Aedat2Layout {
  int x_shift;
  std::uint32_t x_mask;
  int y_shift;
  std::uint32_t y_mask;
  std::uint32_t polarity;  ///< bit of the polarity
  bool set_is_on;          ///< where it is set
  std::uint32_t sample;    ///< bit of samples of frames and of the IMU, if any
  std::uint32_t external;  ///< bit of external events, if any
  std::uint32_t pixel;     ///< bits of which an external event has none
  std::uint32_t largest;   ///< address

  int x(std::uint32_t address) const { return static_cast<int>(address >> x_shift & x_mask); }
  int y(std::uint32_t address) const { return static_cast<int>(address >> y_shift & y_mask); }
  bool is_on(std::uint32_t address) const { return ((address & polarity) != 0) == set_is_on; }
  bool is_sample(std::uint32_t address) const { return (address & sample) != 0; }
  /// v2e marks noise with the bit of external events, and leaves them their pixel.
  bool is_external(std::uint32_t address) const {
    return (address & external) != 0 && (address & pixel) == 0;
  }

  /// Of an external event; only a DAVIS tells edges apart.
  bool is_rising(std::uint32_t address) const {
    constexpr std::uint32_t edge = 7;
    constexpr std::uint32_t falling = 2;
    return pixel == 0 || (address & edge) != falling;
  }

  friend constexpr bool operator==(const Aedat2Layout&, const Aedat2Layout&) = default;
};

inline constexpr Aedat2Layout davis_layout{12,   0x3ff,       22,       0x1ff,       1U << 11,
                                           true, 0x8000'0000, 1U << 10, 0xffff'fbf8, 0xffff'ffff};
inline constexpr Aedat2Layout dvs128_layout{1, 0x7f, 8, 0x7f, 1, false, 0, 0x8000, 0, 0xffff};
/// As v2e has it.
inline constexpr Aedat2Layout dvs640_layout{1, 0x3ff, 11, 0x3ff, 1, true, 0, 0, 0, 0xf'ffff};

/// A camera that a header names.
struct Aedat2Camera {
  std::string_view name;  ///< part of it, in lower case
  SensorSize size;
  Aedat2Layout layout;
};
inline constexpr Aedat2Camera aedat2_cameras[] = {
    {"dvs128", {128, 128}, dvs128_layout},     {"dvs640", {640, 480}, dvs640_layout},
    {"davis128", {128, 128}, davis_layout},    {"davis208", {208, 192}, davis_layout},
    {"davis240", {240, 180}, davis_layout},    {"sbret", {240, 180}, davis_layout},
    {"davis346", {346, 260}, davis_layout},    {"davis640", {640, 480}, davis_layout},
    {"davisrgbw640", {640, 480}, davis_layout}};

/// The layout that addresses are of, as each is of another magnitude. v2e has no DVS128.
inline Aedat2Layout aedat2_layout_of(std::span<const std::uint32_t> addresses, bool of_v2e) {
  const auto many_are_past = [&](std::uint32_t largest) {
    const auto count =
        std::ranges::count_if(addresses, [&](std::uint32_t address) { return address > largest; });
    return 16 * static_cast<std::size_t>(count) > addresses.size();
  };
  if (many_are_past(dvs640_layout.largest)) return davis_layout;
  return of_v2e || many_are_past(dvs128_layout.largest) ? dvs640_layout : dvs128_layout;
}

}  // namespace eventcamera
