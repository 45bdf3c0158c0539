// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/dis/pyramid.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Slopes = hn::CappedTag<std::int16_t, row_padding>;
template <class Lanes>
using BytesFor = hn::Rebind<std::uint8_t, Lanes>;

/// Calls body(x, load) for each vector of a row, where load(pixels) reads no further than `width`.
template <class Bytes, class Body>
HWY_INLINE void for_each_vector(Bytes bytes, int width, const Body& body) {
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes)
    body(x, [&](const std::uint8_t* pixels) { return hn::LoadU(bytes, pixels); });
  if (x < width)
    body(x, [&](const std::uint8_t* pixels) { return load_first(bytes, pixels, width - x); });
}

/// out[x] += weight * row[x]
void add_row(const std::uint8_t* row, float weight, int width, float* out) {
  const Floats floats;
  const auto factor = hn::Set(floats, weight);
  for_each_vector(BytesFor<Floats>(), width, [&](int x, const auto& load) {
    const auto pixels = hn::PromoteTo(hn::RebindToSigned<Floats>(), load(row + x));
    const auto product = factor * hn::ConvertTo(floats, pixels);
    hn::StoreU(hn::LoadU(floats, out + x) + product, floats, out + x);
  });
}

/// Means of 2x2 pixels; halves are rounded up.
void halve_rows(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                std::uint8_t* out) {
  const hn::CappedTag<std::uint16_t, row_padding> words;
  const hn::RebindToSigned<decltype(words)> signed_words;
  const BytesFor<decltype(words)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(bytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const auto pairs = [&](const std::uint8_t* row) {
      hn::Vec<decltype(bytes)> even;
      hn::Vec<decltype(bytes)> odd;
      hn::LoadInterleaved2(bytes, row + std::ptrdiff_t{2} * x, even, odd);
      return hn::PromoteTo(words, even) + hn::PromoteTo(words, odd);
    };
    const auto sum = pairs(upper) + pairs(lower) + hn::Set(words, std::uint16_t{2});
    const auto mean = hn::BitCast(signed_words, hn::ShiftRight<2>(sum));
    hn::StoreU(hn::DemoteTo(bytes, mean), bytes, out + x);
  }
  for (; x < width; ++x) {
    const auto left = std::ptrdiff_t{2} * x;
    const int sum = upper[left] + upper[left + 1] + lower[left] + lower[left + 1];
    out[x] = static_cast<std::uint8_t>((sum + 2) / 4);
  }
}

/// sums = above + 2 * middle + below, differences = below - above
void slope_columns(const std::uint8_t* above, const std::uint8_t* middle, const std::uint8_t* below,
                   int width, std::int16_t* sums, std::int16_t* differences) {
  const Slopes slopes;
  const int lanes = static_cast<int>(hn::Lanes(slopes));
  for (int x = 0; x < width; x += lanes) {
    const auto load = [&](const std::uint8_t* row) {
      return hn::PromoteTo(slopes, hn::LoadU(BytesFor<Slopes>(), row + x));
    };
    const auto a = load(above);
    const auto b = load(below);
    hn::StoreU(a + b + hn::ShiftLeft<1>(load(middle)), slopes, sums + x);
    hn::StoreU(b - a, slopes, differences + x);
  }
}

void slope_row(const std::int16_t* sums, const std::int16_t* differences, int width,
               std::int16_t* slope_x, std::int16_t* slope_y) {
  const Slopes slopes;
  const int lanes = static_cast<int>(hn::Lanes(slopes));
  for (int x = 0; x < width; x += lanes) {
    const auto at = [&](const std::int16_t* row, int k) { return hn::LoadU(slopes, row + x + k); };
    hn::StoreU(at(sums, 1) - at(sums, -1), slopes, slope_x + x);
    hn::StoreU(at(differences, -1) + at(differences, 1) + hn::ShiftLeft<1>(at(differences, 0)),
               slopes, slope_y + x);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(add_row);
HWY_EXPORT(halve_rows);
HWY_EXPORT(slope_columns);
HWY_EXPORT(slope_row);

AreaShrink::Axis::Axis(int from_, int to) : from(from_), first(static_cast<std::size_t>(to)) {
  const auto begin = [&](int i) { return std::int64_t{i} * from; };  // in 1 / to of a pixel
  const auto end_pixel = [&](int i) { return static_cast<int>((begin(i + 1) + to - 1) / to); };
  for (int i = 0; i < to; ++i) {
    first[i] = static_cast<int>(begin(i) / to);
    taps = std::max(taps, end_pixel(i) - first[i]);
  }
  weights.resize(static_cast<std::size_t>(to) * static_cast<std::size_t>(taps));
  for (int i = 0; i < to; ++i) {
    for (int pixel = first[i]; pixel < end_pixel(i); ++pixel) {
      const auto overlap = std::min(std::int64_t{pixel + 1} * to, begin(i + 1)) -
                           std::max(std::int64_t{pixel} * to, begin(i));
      weights[std::ptrdiff_t{i} * taps + pixel - first[i]] = static_cast<float>(overlap);
    }
  }
}

AreaShrink::AreaShrink(int from_width, int from_height, int width, int height)
    : columns_(from_width, width), rows_(from_height, height) {}

void AreaShrink::row(const ImageView<std::uint8_t>& image, int y, std::vector<float>& sums,
                     std::uint8_t* out) const {
  if (columns_.from == 2 * width() && rows_.from == 2 * height()) {
    HWY_DYNAMIC_DISPATCH(halve_rows)(image.row(2 * y), image.row(2 * y + 1), width(), out);
    return;
  }
  const int reached = columns_.from + columns_.taps + row_padding;
  const auto padded_width = static_cast<std::size_t>(reached);
  float* sum = scratch_of(sums, padded_width);
  std::fill_n(sum, padded_width, 0.0F);
  for (int t = 0; t < rows_.taps; ++t) {
    const float weight = rows_.weights_of(y)[t];
    if (weight == 0) continue;
    HWY_DYNAMIC_DISPATCH(add_row)(image.row(rows_.first[y] + t), weight, columns_.from, sum);
  }
  const double area = static_cast<double>(columns_.from) * rows_.from;
  for (int x = 0; x < width(); ++x) {
    const float* pixels = sum + columns_.first[x];
    const float* weights = columns_.weights_of(x);
    double total = 0;
    for (int t = 0; t < columns_.taps; ++t) total += double{weights[t]} * pixels[t];
    out[x] = static_cast<std::uint8_t>(std::lrint(total / area));
  }
}

void PyramidImage::shrink_row(const AreaShrink& shrink, const ImageView<std::uint8_t>& image, int y,
                              std::vector<float>& sums) {
  std::uint8_t* out = grey_.row(y);
  shrink.row(image, y, sums, out);
  std::memset(out - margin, out[0], margin);
  std::memset(out + grey_.width(), out[grey_.width() - 1], margin);
}

void PyramidImage::replicate_rows() {
  const auto copy = [&](int from, int to) {
    std::memcpy(grey_.row(to) - margin, grey_.row(from) - margin,
                static_cast<std::size_t>(grey_.width()) + std::size_t{2} * margin);
  };
  for (int i = 1; i <= margin; ++i) {
    copy(0, -i);
    copy(grey_.height() - 1, grey_.height() - 1 + i);
  }
}

void Gradients::row(const Image<std::uint8_t>& image, int y, std::vector<std::int16_t>& scratch) {
  const int width = image.width();
  const int end = image.height() - 1;
  const auto padded_width = static_cast<std::size_t>(width) + std::size_t{2} * row_padding;
  std::int16_t* sums = scratch_of(scratch, 2 * padded_width) + 1;
  std::int16_t* differences = sums + padded_width;
  const auto mirrored = [&](int i) {
    return std::clamp(i < 0 ? -i : i > end ? 2 * end - i : i, 0, end);
  };
  HWY_DYNAMIC_DISPATCH(slope_columns)
  (image.row(mirrored(y - 1)), image.row(y), image.row(mirrored(y + 1)), width, sums, differences);
  for (std::int16_t* values : {sums, differences}) {
    values[-1] = values[std::min(1, width - 1)];
    values[width] = values[std::max(0, width - 2)];
  }
  HWY_DYNAMIC_DISPATCH(slope_row)(sums, differences, width, x_.row(y), y_.row(y));
}

}  // namespace eventcamera
#endif  // HWY_ONCE
