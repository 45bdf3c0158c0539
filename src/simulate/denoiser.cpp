// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/denoiser.hpp"

#define HWY_TARGET_INCLUDE "src/simulate/denoiser.cpp"
#include <hwy/foreach_target.h>
// Must come after HWY_TARGET_INCLUDE.
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class Pixel>
void denoise_row(const Pixel* above, const Pixel* here, const Pixel* below, int width, int limit,
                 Pixel* out) {
  using Wide = hwy::MakeSigned<hwy::MakeWide<Pixel>>;  // holds a sum of 16 differences
  const hn::ScalableTag<Wide> wide;
  const hn::Rebind<Pixel, decltype(wide)> pixels;
  const int lanes = static_cast<int>(hn::Lanes(wide));
  const auto max = hn::Set(wide, static_cast<Wide>(limit));
  const auto min = hn::Set(wide, static_cast<Wide>(-limit));
  const auto vectors = [&](int x) {
    const auto load = [&](const Pixel* row, int at) {
      return hn::PromoteTo(wide, hn::LoadU(pixels, row + at));
    };
    const auto centre = load(here, x);
    const auto difference = [&](const Pixel* row, int at) {
      return hn::Min(hn::Max(load(row, at) - centre, min), max);
    };
    const auto corners = difference(above, x - 1) + difference(above, x + 1) +
                         (difference(below, x - 1) + difference(below, x + 1));
    const auto sides = difference(above, x) + difference(below, x) +
                       (difference(here, x - 1) + difference(here, x + 1));
    const auto sum = corners + (sides + sides) + hn::Set(wide, 8);
    hn::StoreU(hn::DemoteTo(pixels, centre + hn::ShiftRight<4>(sum)), pixels, out + x);
  };
  const auto one = [&](int x) {
    const int left = std::max(x - 1, 0);
    const int right = std::min(x + 1, width - 1);
    const int centre = here[x];
    const auto difference = [&](const Pixel* row, int at) {
      return std::clamp(row[at] - centre, -limit, limit);
    };
    const int corners = difference(above, left) + difference(above, right) +
                        difference(below, left) + difference(below, right);
    const int sides = difference(above, x) + difference(below, x) + difference(here, left) +
                      difference(here, right);
    out[x] = static_cast<Pixel>(centre + ((corners + 2 * sides + 8) >> 4));
  };

  one(0);
  int x = 1;
  for (; x + lanes < width; x += lanes) vectors(x);
  for (; x < width; ++x) one(x);
}

template <class Pixel>
void denoise_rows(const ImageView<Pixel>& frame, int limit, ThreadPool& threads,
                  Image<Pixel>& out) {
  for_each_row(threads, frame.height, [&](int y) {
    denoise_row(frame.row(std::max(y - 1, 0)), frame.row(y),
                frame.row(std::min(y + 1, frame.height - 1)), frame.width, limit, out.row(y));
  });
}

constexpr auto& denoise_8 = denoise_rows<std::uint8_t>;
constexpr auto& denoise_16 = denoise_rows<std::uint16_t>;

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(denoise_8);
HWY_EXPORT(denoise_16);

void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint8_t>& out) {
  HWY_DYNAMIC_DISPATCH(denoise_8)(frame, limit, threads, out);
}

void denoise(const ImageView<std::uint16_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint16_t>& out) {
  HWY_DYNAMIC_DISPATCH(denoise_16)(frame, limit, threads, out);
}

namespace {

constexpr int block_size = 8;
constexpr int block_area = block_size * block_size;
/// Maximum number of blocks in a row and in a column.
constexpr int max_blocks = 32;
/// Minimum number of blocks for an estimate.
constexpr std::size_t min_blocks = 16;
/// Share of blocks assumed to show only noise.
constexpr double still_share = 0.2;
/// A fifth of the sample deviations of 64 values is below this share of the true one: with the
/// normal approximation, 1 - 0.84 / sqrt(2 * 63).
constexpr double quantile_bias = 0.925;
/// Noise up to this many standard deviations is smoothed.
constexpr double sigmas = 4;
/// Limit of the smoothing; more would remove more edges than noise.
constexpr double max_automatic = 32;
/// Grey levels from black or white that may hide noise.
constexpr double margin = 4;

/// Position of block i of `count`, spread evenly over `size` pixels.
int position(int i, int count, int size) {
  return count > 1 ? i * (size - block_size) / (count - 1) : 0;
}

}  // namespace

void NoiseLevel::update(const LumaView& frame) {
  const double white = (1 << frame.format.bits) - 1;
  if (frame.format.bits > 8)
    update(frame.as<std::uint16_t>(), white);
  else
    update(frame.as<std::uint8_t>(), white);
}

template <class Pixel>
void NoiseLevel::update(const ImageView<Pixel>& frame, double white) {
  const int columns = std::min(frame.width / block_size, max_blocks);
  const int rows = std::min(frame.height / block_size, max_blocks);
  const bool is_first = last_.empty();
  last_.resize(static_cast<std::size_t>(columns) * rows * block_area);
  variances_.clear();
  bool is_repeated = true;
  auto* last = last_.data();
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int left = position(column, columns, frame.width);
      const int top = position(row, rows, frame.height);
      std::int64_t light = 0;
      std::int64_t sum = 0;
      std::int64_t squares = 0;
      for (int y = 0; y < block_size; ++y) {
        const Pixel* pixels = frame.row(top + y) + left;
        for (int x = 0; x < block_size; ++x, ++last) {
          const std::int64_t difference = std::int64_t{pixels[x]} - *last;
          light += pixels[x];
          sum += difference;
          squares += difference * difference;
          *last = pixels[x];
        }
      }
      if (squares != 0) is_repeated = false;
      const double grey = 255 * static_cast<double>(light) / block_area / white;
      if (grey < margin || grey > 255 - margin) continue;
      const double spread = static_cast<double>(squares) -
                            static_cast<double>(sum) * static_cast<double>(sum) / block_area;
      variances_.push_back(static_cast<float>(spread / (block_area - 1)));
    }
  }
  if (is_first || is_repeated || variances_.size() < min_blocks) return;
  const auto fifth = variances_.begin() + static_cast<std::ptrdiff_t>(
                                              still_share * static_cast<double>(variances_.size()));
  std::ranges::nth_element(variances_, fifth);
  // The difference of two frames has the noise of both.
  const double deviation = std::sqrt(*fifth / 2) * 255 / white;
  estimates_[count_++ % estimates_.size()] = deviation / quantile_bias;
}

double NoiseLevel::sigma() const {
  const std::size_t known = std::min(count_, estimates_.size());
  if (known == 0) return 0;
  auto sorted = estimates_;
  const auto median = sorted.begin() + static_cast<std::ptrdiff_t>(known / 2);
  std::nth_element(sorted.begin(), median, sorted.begin() + static_cast<std::ptrdiff_t>(known));
  return *median;
}

void Denoiser::restart() {
  noise_.restart();
  is_first_ = true;
  first_.reset();
}

double Denoiser::amplitude_for(const LumaView& frame, double setting) {
  if (setting != automatic_denoise) return setting;
  noise_.update(frame);
  if (std::exchange(is_first_, false)) keep(frame);
  return std::min(sigmas * noise_.sigma(), max_automatic);
}

void Denoiser::keep(const LumaView& frame) {
  const auto row_size = static_cast<std::size_t>(format_.width) * (format_.bits > 8 ? 2 : 1);
  kept_.resize(row_size * static_cast<std::size_t>(format_.height));
  for (int y = 0; y < format_.height; ++y)
    std::memcpy(kept_.data() + static_cast<std::size_t>(y) * row_size, frame.as<std::byte>().row(y),
                row_size);
  first_ = LumaView{format_, kept_.data(), static_cast<std::ptrdiff_t>(row_size), frame.is_narrow};
}

std::optional<LumaView> Denoiser::kept_first(double amplitude, ThreadPool& threads) {
  const auto first = std::exchange(first_, std::nullopt);
  if (!first || amplitude == 0) return std::nullopt;
  return denoised(*first, amplitude, threads);
}

LumaView Denoiser::denoised(const LumaView& frame, double amplitude, ThreadPool& threads) {
  const int white = (1 << format_.bits) - 1;
  const int limit = static_cast<int>(std::lround(amplitude / 255 * white));
  if (limit <= 0) return frame;
  const auto smooth = [&]<class Pixel>(Image<Pixel>& out) {
    if (out.width() == 0) out = Image<Pixel>(format_.width, format_.height);
    denoise(frame.as<Pixel>(), limit, threads, out);
    return LumaView{format_, out.row(0), out.stride(), frame.is_narrow};
  };
  return format_.bits > 8 ? smooth(words_) : smooth(bytes_);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
