// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/event/event_buckets.hpp"
#include "src/parallel/thread_pool.hpp"
#include "src/picture/plane.hpp"
#include "src/simulate/bands.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Fires where a row of pixels changed by more than the thresholds: ON where now - before > C+,
/// OFF where before - now > C- (paper, section III-A).
void fire_differences(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out);
void fire_differences(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out);

/// The same for whole pictures, into the buckets of one step, which has their bands.
template <class Pixel>
void fire_differences(const PlaneView<Pixel>& before, const PlaneView<Pixel>& now, int step,
                      std::uint32_t t, const Thresholds& thresholds, ThreadPool& threads,
                      EventBuckets& events) {
  threads.for_each(band_count(now.height), [&](int band, int) {
    const BandRows rows(band, now.height);
    for (int y = rows.first; y < rows.last; ++y)
      fire_differences(before.row(y), now.row(y), now.width, y, t, thresholds,
                       events.bucket(step, band));
  });
}

}  // namespace eventcamera
