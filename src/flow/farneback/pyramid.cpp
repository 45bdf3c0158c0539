// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/pyramid.hpp"

#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "src/flow/farneback/scratch.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/farneback/pyramid.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Bytes = hn::Rebind<std::uint8_t, Floats>;
using Vector = hn::Vec<Floats>;

Vector between(Vector a, Vector b, Vector weight) {
  return hn::Add(a, hn::Mul(weight, hn::Sub(b, a)));
}

void resample_one(const float* row, const Resampling& resampling, float* out) {
  const Floats floats;
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < resampling.size(); x += lanes) {
    const auto first = hn::LoadU(words, resampling.first() + x);
    const auto a = hn::GatherIndex(floats, row, first);
    const auto b = hn::GatherIndex(floats, row + 1, first);
    hn::StoreU(between(a, b, hn::LoadU(floats, resampling.weight() + x)), floats, out + x);
  }
}

void resample_two(const float* upper, const float* lower, float weight, int width,
                  const Resampling& resampling, float factor, float* row, float* out) {
  const Floats floats;
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto down = hn::Set(floats, weight);
  const auto times = hn::Set(floats, factor);
  for (int i = 0; i < 2 * width; i += lanes) {
    const auto a = hn::LoadU(floats, upper + i);
    const auto b = hn::LoadU(floats, lower + i);
    hn::StoreU(hn::Mul(between(a, b, down), times), floats, row + i);
  }
  float* end = row + std::ptrdiff_t{2} * width;
  end[0] = end[-2];
  end[1] = end[-1];
  for (int x = 0; x < resampling.size(); x += lanes) {
    const auto first = hn::ShiftLeft<1>(hn::LoadU(words, resampling.first() + x));
    const auto right = hn::LoadU(floats, resampling.weight() + x);
    const auto at = [&](int i) { return hn::GatherIndex(floats, row + i, first); };
    hn::StoreInterleaved2(between(at(0), at(2), right), between(at(1), at(3), right), floats,
                          out + std::ptrdiff_t{2} * x);
  }
}

/// out = sum over t of weights[t] * rows[t]
void add_rows(const std::uint8_t* const* rows, const float* weights, int count, int width,
              float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto add = [&](int x, const auto& load) {
    auto sum = hn::Zero(floats);
    for (int t = 0; t < count; ++t) {
      const auto pixels = hn::PromoteTo(Words(), load(rows[t] + x));
      sum = hn::Add(sum, hn::Mul(hn::Set(floats, weights[t]), hn::ConvertTo(floats, pixels)));
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
    auto sum = hn::Mul(hn::Set(floats, kernel[0]), hn::LoadU(floats, row + x));
    for (int k = 1; k <= reach; ++k) {
      const auto both = hn::Add(hn::LoadU(floats, row + x - k), hn::LoadU(floats, row + x + k));
      sum = hn::Add(sum, hn::Mul(hn::Set(floats, kernel[k]), both));
    }
    hn::StoreU(sum, floats, out + x);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(resample_one);
HWY_EXPORT(resample_two);
HWY_EXPORT(add_rows);
HWY_EXPORT(blur_row);

Resampling::Resampling(int from, int to)
    : size_(to), first_(to + row_padding, 0), weight_(to + row_padding, 0.0F) {
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double place = (i + 0.5) * ratio - 0.5;
    const int before = static_cast<int>(std::floor(place));
    if (before < 0) continue;
    first_[i] = before < from - 1 ? before : from - 1;
    weight_[i] = before < from - 1 ? static_cast<float>(place - before) : 0.0F;
  }
}

void resample_row(const float* row, const Resampling& resampling, float* out) {
  HWY_DYNAMIC_DISPATCH(resample_one)(row, resampling, out);
}

void resample_pairs(const float* upper, const float* lower, float weight, int width,
                    const Resampling& resampling, float factor, float* between, float* out) {
  HWY_DYNAMIC_DISPATCH(resample_two)
  (upper, lower, weight, width, resampling, factor, between, out);
}

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

/// Mirrors an index past the border at the outermost pixel.
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

void PyramidLevel::row(const ImageView<std::uint8_t>& picture, int y, Scratch& scratch,
                       float* out) const {
  const int count = static_cast<int>(kernel_.size());
  const int reach = count / 2;
  const int width = picture.width;
  const auto padded_width = static_cast<std::size_t>(width) + row_padding;

  // Blur and interpolation between two rows in one kernel, one row longer.
  std::array<const std::uint8_t*, max_kernel + 1> rows;
  std::array<float, max_kernel + 1> weights{};
  const float lower = rows_.weight()[y];
  for (int t = 0; t < count; ++t) {
    weights[t] += (1 - lower) * kernel_[t];
    weights[t + 1] += lower * kernel_[t];
  }
  for (int t = 0; t <= count; ++t)
    rows[t] = picture.row(mirrored(rows_.first()[y] - reach + t, picture.height));
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

}  // namespace eventcamera
#endif  // HWY_ONCE
