// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/core/event_buckets.hpp"
#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Adds the pixels of a row that fire: ON where now - before > C+, OFF where before - now > C-
/// (paper, section III-A).
void fire_differences(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                      const Thresholds& thresholds, FiredPixels& out);
void fire_differences(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                      const Thresholds& thresholds, FiredPixels& out);

/// Adds the pixels of a row whose strength is not 0, ON if it is odd, OFF if even, and clears the
/// strengths. `touched` has an element per 64 pixels, 0 only if all of these are 0; it is cleared
/// too.
void fire_strengths(std::uint16_t* strengths, std::uint8_t* touched, int words, int y,
                    FiredPixels& out);
void fire_strengths(std::uint32_t* strengths, std::uint8_t* touched, int words, int y,
                    FiredPixels& out);

/// Smallest range [first, last) of a row that holds all pixels that changed by more than a
/// threshold; empty if none did.
struct ChangedColumns {
  int first;
  int last;
};
ChangedColumns changed_columns(const std::uint8_t* before, const std::uint8_t* now, int width,
                               int threshold);
ChangedColumns changed_columns(const std::uint16_t* before, const std::uint16_t* now, int width,
                               int threshold);

/// Smallest box that holds all pixels of a frame that changed by more than `threshold`.
template <class Pixel>
Box changed_box(const ImageView<Pixel>& before, const ImageView<Pixel>& now, int threshold) {
  Box box;
  for (int y = 0; y < now.height; ++y) {
    const auto columns = changed_columns(before.row(y), now.row(y), now.width, threshold);
    if (columns.first >= columns.last) continue;
    if (box.empty()) box = {columns.first, y, columns.last, y + 1};
    box = {std::min(box.left, columns.first), box.top, std::max(box.right, columns.last), y + 1};
  }
  return box;
}

/// fire_differences() for whole frames, into the buckets of one step, one per band of rows.
template <class Pixel>
void fire_differences(const ImageView<Pixel>& before, const ImageView<Pixel>& now, int step,
                      std::uint32_t t, const Thresholds& thresholds, ThreadPool& threads,
                      StepBuckets& events) {
  threads.for_each(band_count(now.height), [&](int band, int) {
    auto& fired = events.pixels(step, band);
    fired.begin(t);
    const BandRows rows(band, now.height);
    for (int y = rows.first; y < rows.last; ++y)
      fire_differences(before.row(y), now.row(y), now.width, y, thresholds, fired);
  });
}

}  // namespace eventcamera
