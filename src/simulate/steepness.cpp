// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/steepness.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/simulate/steepness.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Bytes = hn::CappedTag<std::uint8_t, Steepness::tile>;

/// The largest |a - b| of some rows, column by column.
class LargestDifference {
 public:
  void add(const std::uint8_t* a, const std::uint8_t* b) {
    for (int x = 0; x < Steepness::tile; x += static_cast<int>(hn::Lanes(Bytes()))) {
      const auto p = hn::LoadU(Bytes(), a + x);
      const auto q = hn::LoadU(Bytes(), b + x);
      const auto difference = hn::Or(hn::SaturatedSub(p, q), hn::SaturatedSub(q, p));
      hn::Store(hn::Max(hn::Load(Bytes(), columns_ + x), difference), Bytes(), columns_ + x);
    }
  }
  std::uint8_t of_all() const { return *std::max_element(columns_, columns_ + Steepness::tile); }

 private:
  HWY_ALIGN std::uint8_t columns_[Steepness::tile] = {};
};

/// A band of tiles. Behind the right border stands the next row, and behind the last one 0: what is
/// measured there is too large at worst.
void measure_band(const PlaneView<std::uint8_t>& picture, int band, std::uint8_t* x_out,
                  std::uint8_t* y_out) {
  const BandRows rows(band, picture.height);
  for (int left = 0; left < picture.width; left += Steepness::tile) {
    LargestDifference x;
    LargestDifference y;
    for (int row = rows.first; row < rows.last; ++row) {
      const std::uint8_t* here = picture.row(row) + left;
      const std::uint8_t* below = picture.row(std::min(row + 1, picture.height - 1)) + left;
      x.add(here, here + 1);
      y.add(here, below);
    }
    x_out[left / Steepness::tile] = x.of_all();
    y_out[left / Steepness::tile] = y.of_all();
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(measure_band);

void Steepness::measure(const PlaneView<std::uint8_t>& picture, ThreadPool& threads) {
  const int columns = (picture.width + tile - 1) / tile;
  const int bands = band_count(picture.height);
  if (x_.width() != columns || x_.height() != bands) {
    x_ = Plane<std::uint8_t>(columns, bands);
    y_ = Plane<std::uint8_t>(columns, bands);
  }
  threads.for_each(bands, [&](int band, int) {
    HWY_DYNAMIC_DISPATCH(measure_band)(picture, band, x_.row(band), y_.row(band));
  });
}

Steepness::Bound Steepness::within(int left, int top, int right, int bottom) const {
  const auto tiles = [](int first, int last, int count) {
    return std::pair(std::clamp(first / tile, 0, count - 1), std::clamp(last / tile, 0, count - 1));
  };
  const auto [first_column, last_column] = tiles(left, right, x_.width());
  const auto [first_row, last_row] = tiles(top, bottom, x_.height());
  Bound bound{0, 0};
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      bound.x = std::max(bound.x, static_cast<int>(x_.at(column, row)));
      bound.y = std::max(bound.y, static_cast<int>(y_.at(column, row)));
    }
  }
  return bound;
}

}  // namespace eventcamera
#endif  // HWY_ONCE
