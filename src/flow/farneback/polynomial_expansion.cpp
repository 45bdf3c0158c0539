// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/polynomial_expansion.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/farneback/polynomial_expansion.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Bytes = hn::Rebind<std::uint8_t, Floats>;

/// out = sum over t of weights[t] * rows[t]
void add_rows(const std::uint8_t* const* rows, const float* weights, int count, int width,
              float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto add = [&](int x, const auto& load) {
    auto sum = hn::Zero(floats);
    for (int t = 0; t < count; ++t) {
      const auto pixels = hn::PromoteTo(Words(), load(rows[t] + x));
      sum = sum + hn::Set(floats, weights[t]) * hn::ConvertTo(floats, pixels);
    }
    hn::StoreU(sum, floats, out + x);
  };
  int x = 0;
  for (; x + lanes <= width; x += lanes)
    add(x, [](const std::uint8_t* pixels) { return hn::LoadU(Bytes(), pixels); });
  if (x < width)  // reading past the rows of a view is not allowed
    add(x, [&](const std::uint8_t* pixels) { return load_first(Bytes(), pixels, width - x); });
}

/// out[x] = sum over t of kernel[t] * row[x + t], with a symmetric kernel
void blur_row(const float* row, const float* kernel, int reach, int width, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  row += reach;
  kernel += reach;
  for (int x = 0; x < width; x += lanes) {
    auto sum = hn::Set(floats, kernel[0]) * hn::LoadU(floats, row + x);
    for (int k = 1; k <= reach; ++k) {
      const auto both = hn::LoadU(floats, row + x - k) + hn::LoadU(floats, row + x + k);
      sum = sum + hn::Set(floats, kernel[k]) * both;
    }
    hn::StoreU(sum, floats, out + x);
  }
}

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

HWY_EXPORT(add_rows);
HWY_EXPORT(blur_row);
HWY_EXPORT(fit_columns);
HWY_EXPORT(fit_row);

namespace {

constexpr int max_kernel = 19;

std::vector<float> kernel_of(int level) {
  if (level == 0) return {0.25F, 0.5F, 0.25F};
  const double sigma = ((1 << level) - 1) * 0.5;
  const int reach = static_cast<int>(std::lrint(sigma * 5)) / 2;
  std::vector<float> kernel(2 * static_cast<std::size_t>(reach) + 1);
  assert(kernel.size() <= max_kernel);
  const auto weight = [&](int k) { return std::exp(-k * k / (2 * sigma * sigma)); };
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) sum += weight(k);
  for (int k = -reach; k <= reach; ++k) kernel[reach + k] = static_cast<float>(weight(k) / sum);
  return kernel;
}

int shrunk(int length, int level) {
  return static_cast<int>(std::lrint(std::ldexp(length, -level)));
}

/// Mirrors an index at the outermost pixels.
int mirrored(int i, int length) {
  if (length == 1) return 0;
  while (i < 0 || i >= length) i = i < 0 ? -i : 2 * (length - 1) - i;
  return i;
}

}  // namespace

PyramidLevel::PyramidLevel(int width, int height, int level)
    : full_size_(level == 0),
      kernel_(kernel_of(level)),
      columns_(width, shrunk(width, level)),
      rows_(height, shrunk(height, level)) {}

void PyramidLevel::row(const ImageView<std::uint8_t>& image, int y, Scratch& scratch,
                       float* out) const {
  const int count = static_cast<int>(kernel_.size());
  const int reach = count / 2;
  const int width = image.width;
  const auto padded_width = static_cast<std::size_t>(width) + row_padding;

  // Blur and interpolation between two rows in one kernel, longer by one row.
  std::array<const std::uint8_t*, max_kernel + 1> rows;
  std::array<float, max_kernel + 1> weights{};
  const float lower = rows_.weight()[y];
  for (int t = 0; t < count; ++t) {
    weights[t] += (1 - lower) * kernel_[t];
    weights[t + 1] += lower * kernel_[t];
  }
  for (int t = 0; t <= count; ++t)
    rows[t] = image.row(mirrored(rows_.first()[y] - reach + t, image.height));
  float* sums =
      scratch_of(scratch.column_sums, padded_width + 2 * static_cast<std::size_t>(reach)) + reach;
  HWY_DYNAMIC_DISPATCH(add_rows)
  (rows.data(), weights.data(), lower > 0 ? count + 1 : count, width, sums);

  for (int k = 1; k <= reach; ++k) {
    sums[-k] = sums[mirrored(-k, width)];
    sums[width - 1 + k] = sums[mirrored(width - 1 + k, width)];
  }
  float* blurred = full_size_ ? out : scratch_of(scratch.blurred, padded_width);
  HWY_DYNAMIC_DISPATCH(blur_row)(sums - reach, kernel_.data(), reach, width, blurred);
  if (!full_size_) resample_row(blurred, columns_, out);
}

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
