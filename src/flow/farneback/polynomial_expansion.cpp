// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/polynomial_expansion.hpp"

#include <algorithm>
#include <cmath>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/farneback/polynomial_expansion.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
constexpr int reach = PolynomialExpansion::reach;
constexpr std::ptrdiff_t group = PolynomialExpansion::group;
constexpr int coefficients = PolynomialExpansion::coefficients;

void fit_columns(const PolynomialExpansion::Window& window, int width, const FitKernels& kernels,
                 float* smooth, float* slope, float* bend) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < width; x += lanes) {
    const auto middle = hn::LoadU(floats, window[reach] + x);
    auto sum0 = hn::Set(floats, kernels.smooth[0]) * middle;
    auto sum1 = hn::Zero(floats);
    auto sum2 = hn::Set(floats, kernels.bend[0]) * middle;
    for (int k = 1; k <= reach; ++k) {
      const auto above = hn::LoadU(floats, window[reach - k] + x);
      const auto below = hn::LoadU(floats, window[reach + k] + x);
      const auto both = above + below;
      sum0 = sum0 + hn::Set(floats, kernels.smooth[k]) * both;
      sum1 = sum1 + hn::Set(floats, kernels.slope[k]) * (below - above);
      sum2 = sum2 + hn::Set(floats, kernels.bend[k]) * both;
    }
    hn::StoreU(sum0, floats, smooth + x);
    hn::StoreU(sum1, floats, slope + x);
    hn::StoreU(sum2, floats, bend + x);
  }
}

void fit_row(const float* smooth, const float* slope, const float* bend, int width,
             const FitKernels& kernels, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < width; x += lanes) {
    const auto set = [&](float value) { return hn::Set(floats, value); };
    const auto at = [&](const float* row, int k) { return hn::LoadU(floats, row + x + k); };
    auto b_y = set(kernels.smooth[0]) * at(slope, 0);
    auto b_x = hn::Zero(floats);
    auto a_yy = set(kernels.smooth[0]) * at(bend, 0);
    auto a_xx = set(kernels.bend[0]) * at(smooth, 0);
    auto a_xy = hn::Zero(floats);
    for (int k = 1; k <= reach; ++k) {
      const auto left = at(smooth, -k);
      const auto right = at(smooth, k);
      const auto left_slope = at(slope, -k);
      const auto right_slope = at(slope, k);
      const auto weight = set(kernels.smooth[k]);
      b_y = b_y + weight * (left_slope + right_slope);
      b_x = b_x + set(kernels.slope[k]) * (right - left);
      a_yy = a_yy + weight * (at(bend, -k) + at(bend, k));
      a_xx = a_xx + set(kernels.bend[k]) * (left + right);
      a_xy = a_xy + set(kernels.slope[k]) * (right_slope - left_slope);
    }
    float* at_x = out + (x / group * group * coefficients + x % group);
    for (const auto& coefficient : {b_y, b_x, a_yy, a_xx, a_xy}) {
      hn::Store(coefficient, floats, at_x);
      at_x += group;
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(fit_columns);
HWY_EXPORT(fit_row);

FitKernels::FitKernels() {
  constexpr double sigma = 1.2;
  double weight[count];
  double sum = 0;
  for (int k = 0; k < count; ++k) {
    weight[k] = std::exp(-k * k / (2 * sigma * sigma));
    sum += k == 0 ? weight[k] : 2 * weight[k];
  }
  double second = 0;  // moments of the weights
  double fourth = 0;
  for (int k = 0; k < count; ++k) {
    weight[k] /= sum;
    second += 2 * weight[k] * k * k;
    fourth += 2 * weight[k] * k * k * k * k;
  }
  // The normal equations decouple: x, y, x y and x^2 - second are orthogonal to all others.
  for (int k = 0; k < count; ++k) {
    smooth[k] = static_cast<float>(weight[k]);
    slope[k] = static_cast<float>(weight[k] * k / second);
    bend[k] = static_cast<float>(weight[k] * (k * k - second) / (fourth - second * second));
  }
}

PolynomialExpansion::PolynomialExpansion(int width, int height)
    : width_(width),
      height_(height),
      groups_(static_cast<int>(place(width + 2 * group)), height + 1) {}

void PolynomialExpansion::fit(int y, const Window& window, Scratch& scratch) {
  static const FitKernels kernels;
  const auto padded_width = static_cast<std::size_t>(width_) + std::size_t{2} * reach + row_padding;
  std::array<float*, 3> rows;
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i] = scratch_of(scratch[i], padded_width) + reach;
  HWY_DYNAMIC_DISPATCH(fit_columns)(window, width_, kernels, rows[0], rows[1], rows[2]);
  for (float* row : rows) {
    std::fill_n(row - reach, reach, row[0]);
    std::fill_n(row + width_, reach, row[width_ - 1]);
  }
  HWY_DYNAMIC_DISPATCH(fit_row)
  (rows[0], rows[1], rows[2], width_, kernels, groups_.row(y));
}

}  // namespace eventcamera
#endif  // HWY_ONCE
