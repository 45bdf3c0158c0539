// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

namespace eventcamera {

/// Bit layout of the 32-bit addresses in AEDAT 2.0 and in jAER's datagrams, which depends on the
/// camera. Columns count from the right and rows from the bottom.
struct AddressLayout {
  int x_shift;
  std::uint32_t x_mask;
  int y_shift;
  std::uint32_t y_mask;
  std::uint32_t polarity;  ///< bit of the polarity
  bool set_is_on;          ///< true: the bit is set for ON events
  std::uint32_t sample;    ///< bit of samples of frames and of the IMU, if any
  std::uint32_t external;  ///< bit of external events, if any
  std::uint32_t pixel;     ///< bits that are 0 in an external event
  std::uint32_t max_address;

  // Maximum size of the sensor.
  constexpr int width() const { return static_cast<int>(x_mask) + 1; }
  constexpr int height() const { return static_cast<int>(y_mask) + 1; }

  std::uint32_t address(int x, int y, bool on) const {
    return static_cast<std::uint32_t>(x) << x_shift | static_cast<std::uint32_t>(y) << y_shift |
           (on == set_is_on ? polarity : 0);
  }
  int x(std::uint32_t address) const { return static_cast<int>(address >> x_shift & x_mask); }
  int y(std::uint32_t address) const { return static_cast<int>(address >> y_shift & y_mask); }
  bool is_on(std::uint32_t address) const { return ((address & polarity) != 0) == set_is_on; }
  bool is_sample(std::uint32_t address) const { return (address & sample) != 0; }
  /// True for an external event. v2e sets the same bit for noise events, which also have a pixel.
  bool is_external(std::uint32_t address) const {
    return (address & external) != 0 && (address & pixel) == 0;
  }

  /// Edge of an external event; only a DAVIS distinguishes edges.
  bool is_rising(std::uint32_t address) const {
    constexpr std::uint32_t edge = 7;
    constexpr std::uint32_t falling = 2;
    return pixel == 0 || (address & edge) != falling;
  }

  friend constexpr bool operator==(const AddressLayout&, const AddressLayout&) = default;
};

inline constexpr AddressLayout davis_layout{12,   0x3ff,       22,       0x1ff,       1U << 11,
                                            true, 0x8000'0000, 1U << 10, 0xffff'fbf8, 0xffff'ffff};
inline constexpr AddressLayout dvs128_layout{1, 0x7f, 8, 0x7f, 1, false, 0, 0x8000, 0, 0xffff};
/// Layout that v2e writes.
inline constexpr AddressLayout dvs640_layout{1, 0x3ff, 11, 0x3ff, 1, true, 0, 0, 0, 0xf'ffff};

}  // namespace eventcamera
