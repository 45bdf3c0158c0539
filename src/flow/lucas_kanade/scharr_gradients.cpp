// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/scharr_gradients.hpp"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/scharr_gradients.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Values = hn::CappedTag<std::int16_t, 16>;
using Bytes = hn::Rebind<std::uint8_t, Values>;

/// Computes columns left ... right - 1 of a row of both gradients, and up to a vector more.
void gradient_row(const Image<std::uint8_t>& image, int y, int left, int right, std::int16_t* out_x,
                  std::int16_t* out_y) {
  const Values values;
  const int lanes = static_cast<int>(hn::Lanes(values));
  const auto ten = hn::Set(values, 10);
  const auto three = hn::Set(values, 3);
  const auto width = hn::Set(values, static_cast<std::int16_t>(image.width()));
  for (int x = left; x < right; x += lanes) {
    const auto load = [&](int row, int column) {
      return hn::PromoteTo(values, hn::LoadU(Bytes(), image.row(row) + column));
    };
    const auto weigh = [&](auto outer, auto middle) {
      return hn::Add(hn::Mul(outer, three), hn::Mul(middle, ten));
    };
    const auto difference = [&](int row) { return hn::Sub(load(row, x + 1), load(row, x - 1)); };
    const auto smooth = [&](int row) {
      return weigh(hn::Add(load(row, x - 1), load(row, x + 1)), load(row, x));
    };
    const auto column = iota(values, static_cast<std::int16_t>(x));
    const auto within = hn::And(hn::Lt(hn::Set(values, -1), column), hn::Lt(column, width));
    const auto dx = weigh(hn::Add(difference(y - 1), difference(y + 1)), difference(y));
    const auto dy = hn::Sub(smooth(y + 1), smooth(y - 1));
    hn::StoreU(hn::IfThenElseZero(within, dx), values, out_x + x - left);
    hn::StoreU(hn::IfThenElseZero(within, dy), values, out_y + x - left);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(gradient_row);

void ScharrGradients::compute(const Image<std::uint8_t>& image, const Box& box) {
  box_ = box;
  const int right = std::min(box.right, image.width() + margin);
  for (int y = box.top; y < box.bottom; ++y) {
    auto* out_x = x_.row(y - box.top);
    auto* out_y = y_.row(y - box.top);
    if (y >= 0 && y < image.height()) {
      HWY_DYNAMIC_DISPATCH(gradient_row)(image, y, box.left, right, out_x, out_y);
    } else {
      std::fill_n(out_x, box.width(), std::int16_t{0});
      std::fill_n(out_y, box.width(), std::int16_t{0});
    }
  }
}

}  // namespace eventcamera
#endif  // HWY_ONCE
