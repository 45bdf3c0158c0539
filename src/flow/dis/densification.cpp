// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/patches.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/dis/densification.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// One lane per pixel.
using Floats = hn::CappedTag<float, row_padding>;
using Vector = hn::Vec<Floats>;
using Field = VariationalRefinement::Field;

/// Weighted sums over the patches that cover the pixels of a row.
struct SumRow {
  float* x;
  float* y;
  float* weight;
};

/// Adds rows [first, last) of a patch at (x, y) with this flow. sums_of(row) returns the sums of a
/// row.
template <int side, class SumsOf>
HWY_INLINE void add_patch(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, int x,
                          int y, int width, int first, int last, const Flow& flow,
                          const SumsOf& sums_of) {
  const hn::CappedTag<float, side> floats;
  const hn::RebindToSigned<decltype(floats)> ints;
  const hn::Rebind<std::uint8_t, decltype(floats)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  // Past these limits, all pixels would be replicated ones.
  const float to_x = std::clamp(static_cast<float>(x) + flow.x, static_cast<float>(-width),
                                static_cast<float>(to.width()));
  const float to_y = std::clamp(static_cast<float>(y) + flow.y, static_cast<float>(y - last),
                                static_cast<float>(to.height()));
  const int left = static_cast<int>(std::floor(to_x));
  const int top = static_cast<int>(std::floor(to_y));
  const auto right = hn::Set(floats, to_x - static_cast<float>(left));
  const auto down = hn::Set(floats, to_y - static_cast<float>(top));
  const auto flow_x = hn::Set(floats, flow.x);
  const auto flow_y = hn::Set(floats, flow.y);
  const auto one = hn::Set(floats, 1.0F);
  const auto load = [&](const std::uint8_t* pixels) {
    return hn::ConvertTo(floats, hn::PromoteTo(ints, hn::LoadU(bytes, pixels)));
  };
  for (int k = 0; k < width; k += lanes) {
    const auto along = [&](int row) {
      const std::uint8_t* pixels = to.row(row - y + top) + left + k;
      return lerp(load(pixels), load(pixels + 1), right);
    };
    auto above = along(first);
    for (int row = first; row < last; ++row) {
      const auto below = along(row + 1);
      const auto there = lerp(above, below, down);
      above = below;
      const auto difference = hn::Abs(there - load(from.row(row) + x + k));
      const auto weight = one / hn::Max(one, difference);
      const SumRow sums = sums_of(row);
      const auto add = [&](float* sum, auto value) {
        hn::StoreU(hn::LoadU(floats, sum + x + k) + value, floats, sum + x + k);
      };
      add(sums.x, weight * flow_x);
      add(sums.y, weight * flow_y);
      add(sums.weight, weight);
    }
  }
}

void divide_row(const SumRow& sums, int y, Field& out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int k = 0; k < out.x.count(0); k += lanes) {
    const auto load = [&](const float* row, Vector* values) {
      hn::LoadInterleaved2(floats, row + std::ptrdiff_t{2} * k, values[0], values[1]);
    };
    Vector x[2];
    Vector y_[2];
    Vector weight[2];
    load(sums.x, x);
    load(sums.y, y_);
    load(sums.weight, weight);
    for (int parity = 0; parity < 2; ++parity) {
      hn::StoreU(x[parity] / weight[parity], floats, out.x.row(parity, y) + k);
      hn::StoreU(y_[parity] / weight[parity], floats, out.y.row(parity, y) + k);
    }
  }
  out.x.replicate_ends(y);
  out.y.replicate_ends(y);
}

template <int side>
void spread(const PatchGrid& grid, const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
            const Image<Flow>& flows, int first, int last, std::vector<float>& scratch,
            Field& out) {
  const int padded_width = from.width() + 3 * row_padding;
  float* sums = scratch_of(scratch, std::size_t{3} * static_cast<std::size_t>(padded_width) *
                                        static_cast<std::size_t>(last - first));
  const auto sums_of = [&](int row) -> SumRow {
    float* values = sums + std::ptrdiff_t{row - first} * 3 * padded_width;
    return {values, values + padded_width, values + std::ptrdiff_t{2} * padded_width};
  };
  const int width = from.width();
  for (int row = first; row < last; ++row) {
    const SumRow sum = sums_of(row);
    std::fill_n(sum.x, 2 * padded_width + width, 0.0F);
    std::fill(sum.weight + width, sum.weight + padded_width, 1.0F);
  }
  const int first_patches = std::clamp((first - side) / grid.stride, 0, grid.rows - 1);
  for (int j = first_patches; j < grid.rows && j * grid.stride < last; ++j) {
    const int top = std::max(first, j * grid.stride);
    const int bottom = std::min(last, j == grid.rows - 1 ? last : j * grid.stride + side);
    for (int i = 0; i < grid.columns; ++i) {
      const int left = i * grid.stride;
      const int covered = i == grid.columns - 1 ? width - left : side;
      add_patch<side>(from, to, left, j * grid.stride, covered, top, bottom, flows.at(i, j),
                      sums_of);
    }
  }
  for (int row = first; row < last; ++row) divide_row(sums_of(row), row, out);
}

void spread_rows(const PatchGrid& grid, const Image<std::uint8_t>& from,
                 const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                 std::vector<float>& sums, Field& out) {
  if (grid.side == 4)
    spread<4>(grid, from, to, flows, first, last, sums, out);
  else
    spread<8>(grid, from, to, flows, first, last, sums, out);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(spread_rows);

void spread_patches(const PatchGrid& grid, const Image<std::uint8_t>& from,
                    const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                    std::vector<float>& sums, VariationalRefinement::Field& out) {
  HWY_DYNAMIC_DISPATCH(spread_rows)(grid, from, to, flows, first, last, sums, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
