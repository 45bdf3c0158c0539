// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/exposure_gain.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "src/dvs/light_response.hpp"

namespace eventcamera {
namespace {

constexpr int block_side = 8;
constexpr int region_rows = 4;  ///< and columns
constexpr std::size_t min_regions = 8;

/// Luma up to which black level and quantisation distort the gain; white is 255.
constexpr int dark_luma = 16;

int block_count(int side) {
  return (side + block_side - 1) / block_side;
}

/// Median of `values`, which must not be empty; the upper one of an even number.
double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Logarithm of a block's gain; NaN if fewer than half of a whole block's pixels are usable in both
/// frames.
template <class Pixel>
double block_gain(const ImageView<Pixel>& last, const ImageView<Pixel>& now, const Box& block,
                  const std::vector<std::uint16_t>& light) {
  const auto white = static_cast<Pixel>(light.size() - 1);
  std::uint32_t last_sum = 0;
  std::uint32_t now_sum = 0;
  int usable = 0;
  for (int y = block.top; y < block.bottom; ++y) {
    for (int x = block.left; x < block.right; ++x) {
      const std::uint32_t before = light[std::min(last.row(y)[x], white)];
      const std::uint32_t after = light[std::min(now.row(y)[x], white)];
      if (before == 0 || after == 0) continue;
      last_sum += before;
      now_sum += after;
      ++usable;
    }
  }
  if (2 * usable < block_side * block_side) return std::numeric_limits<double>::quiet_NaN();
  return std::log(static_cast<double>(now_sum) / last_sum);
}

}  // namespace

ExposureGain::ExposureGain(int bits, bool linear_light) : light_(std::size_t{1} << bits) {
  const int white = static_cast<int>(light_.size()) - 1;
  for (int luma = dark_luma * white / 255 + 1; luma < saturated_luma(white); ++luma)
    light_[luma] = static_cast<std::uint16_t>(
        std::lround(65535 * light_of(luma / static_cast<double>(white), linear_light)));
}

template <class Pixel>
double ExposureGain::between(const ImageView<Pixel>& last, const ImageView<Pixel>& now,
                             ThreadPool& threads) {
  const int columns = block_count(now.width);
  const int rows = block_count(now.height);
  gains_.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  threads.for_each(rows, [&](int row, int) {
    double* gains = gains_.data() + static_cast<std::ptrdiff_t>(row) * columns;
    for (int column = 0; column < columns; ++column) {
      const int left = column * block_side;
      const int top = row * block_side;
      const Box block{left, top, std::min(left + block_side, now.width),
                      std::min(top + block_side, now.height)};
      gains[column] = block_gain(last, now, block, light_);
    }
  });

  std::vector<double> in_region[region_rows * region_rows];
  for (int row = 0; row < rows; ++row) {
    const double* gains = gains_.data() + static_cast<std::ptrdiff_t>(row) * columns;
    for (int column = 0; column < columns; ++column) {
      const double gain = gains[column];
      if (std::isnan(gain)) continue;
      const int region = row * region_rows / rows * region_rows + column * region_rows / columns;
      in_region[region].push_back(gain);
    }
  }
  std::vector<double> regions;
  for (auto& gains : in_region)
    if (!gains.empty()) regions.push_back(median(gains));
  if (regions.size() < min_regions) return 1;

  const double gain = median(regions);
  const double change = std::abs(gain);
  if (change < std::log(min_gain) || change > std::log(max_gain)) return 1;
  const auto agreeing = std::ranges::count_if(
      regions, [&](double other) { return 2 * std::abs(other - gain) <= change; });
  return 4 * static_cast<std::size_t>(agreeing) >= 3 * regions.size() ? std::exp(gain) : 1;
}

template double ExposureGain::between(const ImageView<std::uint8_t>&,
                                      const ImageView<std::uint8_t>&, ThreadPool&);
template double ExposureGain::between(const ImageView<std::uint16_t>&,
                                      const ImageView<std::uint16_t>&, ThreadPool&);

template <class Pixel>
void expose(Image<Pixel>& frame, int bits, bool linear_light, double gain, ThreadPool& threads) {
  const int white = (1 << bits) - 1;
  std::vector<Pixel> exposed(std::size_t{1} << bits);
  for (int luma = 0; luma <= white; ++luma) {
    const double light = light_of(luma / static_cast<double>(white), linear_light);
    const double brighter = std::min(1.0, luma_of(gain * light, linear_light));
    exposed[luma] =
        static_cast<Pixel>(luma < saturated_luma(white) ? std::lround(white * brighter) : luma);
  }
  for_each_row(threads, frame.height(), [&](int y) {
    Pixel* row = frame.row(y);
    for (int x = 0; x < frame.width(); ++x)
      row[x] = exposed[std::min<std::size_t>(row[x], static_cast<std::size_t>(white))];
  });
}

template void expose(Image<std::uint8_t>&, int, bool, double, ThreadPool&);
template void expose(Image<std::uint16_t>&, int, bool, double, ThreadPool&);

}  // namespace eventcamera
