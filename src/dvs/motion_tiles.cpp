// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/motion_tiles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/core/max_side.hpp"
#include "src/flow/flow_range.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/dvs/motion_tiles.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

constexpr int columns_at_once = 64;

/// Finds the minimum and maximum luma of each cell of `side` columns, in these rows of a frame.
template <class Pixel>
void find_ranges(const ImageView<Pixel>& frame, int top, int bottom, int side,
                 std::uint16_t* darkest, std::uint16_t* brightest) {
  const hn::CappedTag<Pixel, columns_at_once> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  HWY_ALIGN Pixel low[columns_at_once];
  HWY_ALIGN Pixel high[columns_at_once];
  HWY_ALIGN Pixel end_of_row[columns_at_once];
  for (int left = 0; left < frame.width; left += columns_at_once) {
    const int count = std::min(columns_at_once, frame.width - left);
    std::fill_n(low, columns_at_once, std::numeric_limits<Pixel>::max());
    std::fill_n(high, columns_at_once, Pixel{0});
    for (int y = top; y < bottom; ++y) {
      const Pixel* luma = frame.row(y) + left;
      if (count < columns_at_once) {
        std::copy_n(luma, count, end_of_row);
        std::fill(end_of_row + count, end_of_row + columns_at_once, luma[count - 1]);
        luma = end_of_row;
      }
      for (int x = 0; x < columns_at_once; x += lanes) {
        const auto here = hn::LoadU(pixels, luma + x);
        hn::Store(hn::Min(hn::Load(pixels, low + x), here), pixels, low + x);
        hn::Store(hn::Max(hn::Load(pixels, high + x), here), pixels, high + x);
      }
    }
    for (int x = 0; x < count; x += side) {
      *darkest++ = *std::min_element(low + x, low + x + side);
      *brightest++ = *std::max_element(high + x, high + x + side);
    }
  }
}

void find_ranges_8(const ImageView<std::uint8_t>& frame, int top, int bottom, int side,
                   std::uint16_t* darkest, std::uint16_t* brightest) {
  find_ranges(frame, top, bottom, side, darkest, brightest);
}

void find_ranges_16(const ImageView<std::uint16_t>& frame, int top, int bottom, int side,
                    std::uint16_t* darkest, std::uint16_t* brightest) {
  find_ranges(frame, top, bottom, side, darkest, brightest);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(find_ranges_8);
HWY_EXPORT(find_ranges_16);

namespace {

/// Maximum motion along which looking up the luma is worth its time, in pixels.
constexpr float max_looked_up = 64;

/// Steps of a tile in which pixels move by up to `max_motion` pixels. Between steps the luma is a
/// straight line; where it bends, events err by a time in proportion to the motion, and to the
/// inverse square of the steps. So from `fine` pixels on, steps grow with the square root of the
/// motion, and the error stays the same.
int steps_for(float max_motion, int max_steps) {
  constexpr float fine = 4;
  const float steps = max_motion <= fine ? max_motion : std::sqrt(fine * max_motion);
  return std::clamp(static_cast<int>(std::ceil(steps)), 1, max_steps);
}

}  // namespace

template <class Pixel>
void MotionTiles::Cells::measure(const ImageView<Pixel>& frame, ThreadPool& threads) {
  const int columns = (frame.width + side - 1) / side;
  const int rows = (frame.height + side - 1) / side;
  if (darkest.width() != columns || darkest.height() != rows) {
    darkest = Image<std::uint16_t>(columns, rows);
    brightest = Image<std::uint16_t>(columns, rows);
  }
  threads.for_each(rows, [&](int row, int) {
    const int top = row * side;
    const int bottom = std::min(top + side, frame.height);
    if constexpr (sizeof(Pixel) == 1) {
      HWY_DYNAMIC_DISPATCH(find_ranges_8)
      (frame, top, bottom, side, darkest.row(row), brightest.row(row));
    } else {
      HWY_DYNAMIC_DISPATCH(find_ranges_16)
      (frame, top, bottom, side, darkest.row(row), brightest.row(row));
    }
  });
}

void MotionTiles::Cells::add_range_of(const Box& box, Tile& tile) const {
  const auto cell = [](int pixel, int cells) { return std::clamp(pixel / side, 0, cells - 1); };
  const int right = cell(box.right - 1, darkest.width());
  const int bottom = cell(box.bottom - 1, darkest.height());
  for (int y = cell(box.top, darkest.height()); y <= bottom; ++y) {
    for (int x = cell(box.left, darkest.width()); x <= right; ++x) {
      tile.darkest = std::min<int>(tile.darkest, darkest.at(x, y));
      tile.brightest = std::max<int>(tile.brightest, brightest.at(x, y));
    }
  }
}

template <class Pixel>
void MotionTiles::measure(const ImageView<Pixel>& last, const ImageView<Pixel>& now,
                          const ImageView<Flow>& flow, int max_steps, ThreadPool& threads) {
  columns_ = (flow.width + width - 1) / width;
  rows_ = (flow.height + height - 1) / height;
  tiles_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  last_.measure(last, threads);
  now_.measure(now, threads);
  threads.for_each(rows_, [&](int row, int) {
    auto* tiles = tiles_.data() + std::ptrdiff_t{row} * columns_;
    for (int column = 0; column < columns_; ++column) {
      const Box box{column * width, row * height, std::min((column + 1) * width, flow.width),
                    std::min((row + 1) * height, flow.height)};
      const auto range = flow_range(flow, box);
      const auto max_motion = std::min(range.max_length(), static_cast<float>(max_side));
      auto& tile = tiles[column];
      tile = {steps_for(max_motion, max_steps), std::numeric_limits<Pixel>::max(), 0};
      if (max_motion > max_looked_up) {
        std::swap(tile.darkest, tile.brightest);
        continue;
      }
      // Samples reach a pixel further, and are rounded.
      const auto up = [](float flow_here) { return static_cast<int>(std::ceil(flow_here)) + 2; };
      last_.add_range_of({box.left - up(range.x.max), box.top - up(range.y.max),
                          box.right + up(-range.x.min), box.bottom + up(-range.y.min)},
                         tile);
      now_.add_range_of({box.left - up(-range.x.min), box.top - up(-range.y.min),
                         box.right + up(range.x.max), box.bottom + up(range.y.max)},
                        tile);
    }
  });
}

template void MotionTiles::measure(const ImageView<std::uint8_t>&, const ImageView<std::uint8_t>&,
                                   const ImageView<Flow>&, int, ThreadPool&);
template void MotionTiles::measure(const ImageView<std::uint16_t>&, const ImageView<std::uint16_t>&,
                                   const ImageView<Flow>&, int, ThreadPool&);

}  // namespace eventcamera
#endif  // HWY_ONCE
