// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/filter/stamped_pixels.hpp"

namespace eventcamera {

/// Decides on events by the stamps of their pixels' neighbours, then stamps their own pixels. The
/// correlation time is less than max_stamp_age.

/// Keeps an event if at least `needed` of 8 neighbours fired within the correlation time. Cells
/// need a margin of 1.
void find_neighbour_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                            unsigned needed);

inline constexpr int kernel_radius = 2;

/// Keeps an event if the remaining correlation times of 24 neighbours add up to at least `needed`;
/// the sum must fit into 31 bits. Cells need a margin of kernel_radius.
void find_kernel_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                         std::uint32_t needed);

}  // namespace eventcamera
