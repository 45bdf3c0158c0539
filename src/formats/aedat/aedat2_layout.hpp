// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "src/core/address_layout.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// A camera that a header names.
struct Aedat2Camera {
  std::string_view name;  ///< part of it, in lower case
  SensorSize size;
  AddressLayout layout;
};
inline constexpr Aedat2Camera aedat2_cameras[] = {
    {"dvs128", {128, 128}, dvs128_layout},     {"dvs640", {640, 480}, dvs640_layout},
    {"davis128", {128, 128}, davis_layout},    {"davis208", {208, 192}, davis_layout},
    {"davis240", {240, 180}, davis_layout},    {"sbret", {240, 180}, davis_layout},
    {"davis346", {346, 260}, davis_layout},    {"davis640", {640, 480}, davis_layout},
    {"davisrgbw640", {640, 480}, davis_layout}};

/// Layout of addresses, inferred from their magnitude. v2e has no DVS128.
inline AddressLayout aedat2_layout_of(std::span<const std::uint32_t> addresses, bool of_v2e) {
  const auto many_are_past = [&](std::uint32_t max_address) {
    const auto count = std::ranges::count_if(
        addresses, [&](std::uint32_t address) { return address > max_address; });
    return 16 * static_cast<std::size_t>(count) > addresses.size();
  };
  if (many_are_past(dvs640_layout.max_address)) return davis_layout;
  return of_v2e || many_are_past(dvs128_layout.max_address) ? dvs640_layout : dvs128_layout;
}

}  // namespace eventcamera
