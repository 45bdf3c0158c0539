// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/reconstruct/reconstruction.hpp"

#define HWY_TARGET_INCLUDE "src/reconstruct/reconstruction.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

// Capped so that no vector exceeds the row padding of an Image.
using Lanes = hn::CappedTag<float, 16>;

/// out[x] = weights[0] at(x, 0) + sum of weights[i] (at(x, -i) + at(x, i)), up to the padding.
template <class At>
HWY_INLINE void weigh(std::span<const float> weights, int width, const At& at, float* out) {
  const Lanes lanes;
  for (int x = 0; x < width; x += static_cast<int>(hn::Lanes(lanes))) {
    auto sum = hn::Set(lanes, weights[0]) * hn::LoadU(lanes, at(x, 0));
    for (int i = 1; i < static_cast<int>(weights.size()); ++i) {
      const auto pair = hn::LoadU(lanes, at(x, -i)) + hn::LoadU(lanes, at(x, i));
      sum = sum + hn::Set(lanes, weights[static_cast<std::size_t>(i)]) * pair;
    }
    hn::StoreU(sum, lanes, out + x);
  }
}

/// Smooths the rows and columns of `image` with a symmetric kernel. Pixels at the border continue
/// outside. `row` has a margin.
void smooth(const Image<float>& image, std::span<const float> weights, Image<float>& row,
            Image<float>& out) {
  const int width = image.width();
  const int last = image.height() - 1;
  const int radius = static_cast<int>(weights.size()) - 1;
  float* const middle = row.row(0);
  for (int y = 0; y <= last; ++y) {
    weigh(
        weights, width, [&](int x, int i) { return image.row(std::clamp(y + i, 0, last)) + x; },
        middle);
    std::fill_n(middle - radius, radius, middle[0]);
    std::fill_n(middle + width, radius, middle[width - 1]);
    weigh(
        weights, width, [middle](int x, int i) { return middle + x + i; }, out.row(y));
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(smooth);

namespace {

/// Right half of a Gaussian whose sum over both halves is 1.
std::vector<float> gaussian(double deviation) {
  std::vector<double> half{1};
  double sum = 1;
  for (int i = 1; i <= std::ceil(2.5 * deviation); ++i) {
    half.push_back(std::exp(-i * i / (2 * deviation * deviation)));
    sum += 2 * half.back();
  }
  std::vector<float> weights(half.size());
  std::ranges::transform(half, weights.begin(),
                         [sum](double weight) { return static_cast<float>(weight / sum); });
  return weights;
}

}  // namespace

Reconstruction::Reconstruction(int width, int height, const Settings& settings)
    : weights_(gaussian(settings.smoothing)),
      levels_(width, height, 1),
      means_(width, height),
      picture_(width, height),
      row_(width, 1, static_cast<int>(weights_.size()) - 1) {
  const double omega = 2 * std::numbers::pi / settings.cutoff;
  const double phi = 2 - std::cos(omega);
  const double decay = phi - std::sqrt(phi * phi - 1);
  decay_ = static_cast<float>(decay);
  gain_ = static_cast<float>((1 + decay) / 2);
  mean_gain_ = static_cast<float>(1 - (1 - std::sin(omega)) / std::cos(omega));
}

void Reconstruction::finish_picture() {
  HWY_DYNAMIC_DISPATCH(smooth)(levels_, weights_, row_, picture_);
  double squares = 0;
  std::size_t pixels = 0;
  for (int y = 0; y < picture_.height(); ++y)
    for (int x = 0; x < picture_.width(); ++x) {
      const double level = picture_.at(x, y);
      squares += level * level;
      pixels += level != 0 ? 1 : 0;
    }
  scale_ = pixels > 0 ? static_cast<float>(1 / (range * std::sqrt(squares / pixels))) : 0;
}

}  // namespace eventcamera
#endif  // HWY_ONCE
