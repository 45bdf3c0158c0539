// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/texture.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/texture.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/flow/lucas_kanade/window_sums-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

TilePixels textured_pixels(const ScharrGradients& gradients, const Tile& tile) {
  const Columns columns;
  const hn::Rebind<std::int16_t, Columns> slopes;
  const hn::Rebind<float, Columns> floats;
  // Upper bound of the rounding of these sums, and of those of a search, relative to xx + yy.
  constexpr float rounding = 1e-8F;
  TilePixels textured{};
  sum_windows<3>(
      Tile::side,
      [&](int row, int column) {
        const int x = tile.left - Tile::before + column;
        const int y = tile.top - Tile::before + row;
        const auto dx = hn::PromoteTo(columns, hn::LoadU(slopes, gradients.x(y) + x));
        const auto dy = hn::PromoteTo(columns, hn::LoadU(slopes, gradients.y(y) + x));
        return std::array<Column, 3>{hn::Mul(dx, dx), hn::Mul(dx, dy), hn::Mul(dy, dy)};
      },
      [&](int row, int column, const auto& left, const auto& right) {
        const auto sum = [&](std::size_t k) {
          return hn::Mul(hn::Add(hn::ConvertTo(floats, left[k]), hn::ConvertTo(floats, right[k])),
                         hn::Set(floats, slope_product));
        };
        const auto xx = sum(0);
        const auto yy = sum(2);
        const auto margin = hn::Mul(hn::Add(xx, yy), hn::Set(floats, rounding));
        const auto enough = hn::Ge(hn::Add(least_eigenvalue(floats, xx, sum(1), yy), margin),
                                   hn::Set(floats, min_texture));
        textured[static_cast<std::size_t>(row)] |=
            static_cast<std::uint16_t>(bits_of(floats, enough) << column);
      });
  return textured;
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(textured_pixels);

TilePixels textured_pixels(const ScharrGradients& gradients, const Tile& tile) {
  return HWY_DYNAMIC_DISPATCH(textured_pixels)(gradients, tile);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
