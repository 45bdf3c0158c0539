// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/gradient_bound.hpp"

#include <algorithm>

#define HWY_TARGET_INCLUDE "src/simulate/gradient_bound.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Columns measured at once; vectors are capped at this width.
constexpr int columns_at_once = 16;
using Bytes = hn::CappedTag<std::uint8_t, columns_at_once>;

/// Largest |a - b| over the added rows, per column.
class LargestDifference {
 public:
  void add(const std::uint8_t* a, const std::uint8_t* b) {
    for (int x = 0; x < columns_at_once; x += static_cast<int>(hn::Lanes(Bytes()))) {
      const auto p = hn::LoadU(Bytes(), a + x);
      const auto q = hn::LoadU(Bytes(), b + x);
      const auto difference = hn::Or(hn::SaturatedSub(p, q), hn::SaturatedSub(q, p));
      hn::Store(hn::Max(hn::Load(Bytes(), columns_ + x), difference), Bytes(), columns_ + x);
    }
  }
  std::uint8_t of_cell(int cell) const {
    const auto* c = columns_ + std::ptrdiff_t{4} * cell;
    return std::max(std::max(c[0], c[1]), std::max(c[2], c[3]));
  }

 private:
  HWY_ALIGN std::uint8_t columns_[columns_at_once] = {};
};

/// Measures the row of 4x4 cells that starts at image row `top`. Reads past the right border, which
/// can only increase the bound.
void measure_row(const ImageView<std::uint8_t>& image, int top, std::uint8_t* x_out,
                 std::uint8_t* y_out) {
  const int bottom = std::min(top + 4, image.height);
  for (int left = 0; left < image.width; left += columns_at_once) {
    LargestDifference x;
    LargestDifference y;
    for (int row = top; row < bottom; ++row) {
      const std::uint8_t* here = image.row(row) + left;
      const std::uint8_t* below = image.row(std::min(row + 1, image.height - 1)) + left;
      x.add(here, here + 1);
      y.add(here, below);
    }
    for (int cell = 0; cell < 4; ++cell) {
      x_out[left / 4 + cell] = x.of_cell(cell);
      y_out[left / 4 + cell] = y.of_cell(cell);
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(measure_row);

namespace {

/// Each large cell is the maximum of its 4x4 small cells.
void gather_row(const Image<std::uint8_t>& small, int row, Image<std::uint8_t>& large) {
  for (int column = 0; column < large.width(); ++column) {
    std::uint8_t largest = 0;
    for (int y = 4 * row; y < 4 * row + 4; ++y)
      for (int x = 4 * column; x < 4 * column + 4; ++x) largest = std::max(largest, small.at(x, y));
    large.at(column, row) = largest;
  }
}

}  // namespace

void GradientBound::Cells::shape(int cell_side, int columns, int rows) {
  side = cell_side;
  if (x.width() == columns && x.height() == rows) return;
  x = Image<std::uint8_t>(columns, rows);
  y = Image<std::uint8_t>(columns, rows);
}

void GradientBound::measure(const ImageView<std::uint8_t>& image, ThreadPool& threads) {
  const int columns = (image.width + 15) / 16;
  const int rows = (image.height + 15) / 16;
  far_.shape(16, columns, rows);
  near_.shape(4, 4 * columns, 4 * rows);
  threads.for_each(rows, [&](int row, int) {
    for (int y = 4 * row; y < 4 * row + 4 && 4 * y < image.height; ++y)
      HWY_DYNAMIC_DISPATCH(measure_row)(image, 4 * y, near_.x.row(y), near_.y.row(y));
    gather_row(near_.x, row, far_.x);
    gather_row(near_.y, row, far_.y);
  });
}

GradientBound::Bound GradientBound::within(const Box& box) const {
  constexpr int near = 40;
  return box.width() <= near && box.height() <= near ? near_.within(box) : far_.within(box);
}

GradientBound::Bound GradientBound::Cells::within(const Box& box) const {
  const int left = std::clamp(box.left / side, 0, x.width() - 1);
  const int right = std::clamp((box.right - 1) / side, 0, x.width() - 1);
  const int top = std::clamp(box.top / side, 0, x.height() - 1);
  const int bottom = std::clamp((box.bottom - 1) / side, 0, x.height() - 1);
  std::uint8_t max_x = 0;
  std::uint8_t max_y = 0;
  for (int row = top; row <= bottom; ++row) {
    const auto* x_row = x.row(row);
    const auto* y_row = y.row(row);
    for (int column = left; column <= right; ++column) {
      max_x = std::max(max_x, x_row[column]);
      max_y = std::max(max_y, y_row[column]);
    }
  }
  return {max_x, max_y};
}

}  // namespace eventcamera
#endif  // HWY_ONCE
