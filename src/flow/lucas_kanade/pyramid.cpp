// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/pyramid.hpp"

#include <algorithm>

#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/pyramid.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Words = hn::CappedTag<std::uint16_t, 16>;
using Bytes = hn::Rebind<std::uint8_t, Words>;

/// Length limit of a blurred row: an image row, two pixels more on each side, and a vector.
constexpr int max_row = 16384 + 64;

// NOLINTBEGIN(clang-analyzer-core.uninitialized.Assign): the second loop reads what the first
// wrote; lanes beyond that are not used.
/// Computes row y of the next level from the rows around row 2y of this one. Writes up to a vector
/// past the end.
void halve_row(const Image<std::uint8_t>& image, int y, std::uint8_t* out, int width) {
  const Words words;
  const Bytes bytes;
  const int lanes = static_cast<int>(hn::Lanes(words));
  HWY_ALIGN std::uint16_t blurred[max_row];
  const auto load = [&](int row, int x) {
    return hn::PromoteTo(words, hn::LoadU(bytes, image.row(row) + x));
  };
  constexpr int before = 2;
  const int columns = before + 2 * width + 2;
  for (int i = 0; i < columns; i += lanes) {
    const int x = i - before;
    const auto outer = load(2 * y - 2, x) + load(2 * y + 2, x);
    const auto inner = load(2 * y - 1, x) + load(2 * y + 1, x);
    const auto middle = load(2 * y, x);
    const auto sum = outer + hn::ShiftLeft<2>(inner + middle) + hn::ShiftLeft<1>(middle);
    hn::StoreU(sum, words, blurred + i);
  }
  for (int x = 0; x < width; x += lanes) {
    const std::uint16_t* at = blurred + std::ptrdiff_t{2} * x;
    hn::Vec<Words> left2;
    hn::Vec<Words> left1;
    hn::Vec<Words> middle;
    hn::Vec<Words> right1;
    hn::Vec<Words> right2;
    hn::Vec<Words> unused;
    hn::LoadInterleaved2(words, at, left2, left1);
    hn::LoadInterleaved2(words, at + 2, middle, right1);
    hn::LoadInterleaved2(words, at + 4, right2, unused);
    const auto inner = hn::ShiftLeft<2>(left1 + right1 + middle);
    const auto sum = left2 + right2 + inner + hn::ShiftLeft<1>(middle);
    const auto rounded = hn::ShiftRight<8>(sum + hn::Set(words, 128));
    hn::StoreU(hn::DemoteTo(bytes, hn::BitCast(hn::RebindToSigned<Words>(), rounded)), bytes,
               out + x);
  }
}

// NOLINTEND(clang-analyzer-core.uninitialized.Assign)

using Values = hn::CappedTag<std::int16_t, 16>;

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
    const auto weigh = [&](auto outer, auto middle) { return outer * three + middle * ten; };
    const auto difference = [&](int row) { return load(row, x + 1) - load(row, x - 1); };
    const auto smooth = [&](int row) {
      return weigh(load(row, x - 1) + load(row, x + 1), load(row, x));
    };
    const auto column = iota(values, static_cast<std::int16_t>(x));
    const auto within = hn::And(hn::Set(values, -1) < column, column < width);
    const auto dx = weigh(difference(y - 1) + difference(y + 1), difference(y));
    const auto dy = smooth(y + 1) - smooth(y - 1);
    hn::StoreU(hn::IfThenElseZero(within, dx), values, out_x + x - left);
    hn::StoreU(hn::IfThenElseZero(within, dy), values, out_y + x - left);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(halve_row);
HWY_EXPORT(gradient_row);

namespace {

/// Reflects a position at the border; the border pixel is not repeated.
int reflected(int p, int size) {
  if (size == 1) return 0;
  const int period = 2 * (size - 1);
  const int q = ((p % period) + period) % period;
  return std::min(q, period - q);
}

void reflect_sides(Image<std::uint8_t>& image, int y) {
  std::uint8_t* row = image.row(y);
  const int width = image.width();
  if (width > Pyramid::margin) {  // without the divisions of reflected()
    for (int i = 1; i <= Pyramid::margin; ++i) {
      row[-i] = row[i];
      row[width - 1 + i] = row[width - 1 - i];
    }
    return;
  }
  for (int i = 1; i <= Pyramid::margin; ++i) row[-i] = row[reflected(-i, width)];
  for (int i = 0; i < Pyramid::margin; ++i) row[width + i] = row[reflected(width + i, width)];
}

/// Copies row y, with its margin, to the rows above and below the image that it is reflected to.
void reflect_row(Image<std::uint8_t>& image, int y) {
  const int height = image.height();
  constexpr int margin = Pyramid::margin;
  const auto copy_to = [&](int to) {
    std::copy_n(image.row(y) - margin, image.width() + 2 * margin, image.row(to) - margin);
  };
  if (y > margin && y < height - 1 - margin) return;
  for (int i = 1; i <= margin; ++i) {
    if (reflected(-i, height) == y) copy_to(-i);
    if (reflected(height - 1 + i, height) == y) copy_to(height - 1 + i);
  }
}

}  // namespace

void Pyramid::shape(int width, int height) {
  if (!levels_.empty() && levels_[0].width() == width && levels_[0].height() == height) return;
  levels_.clear();
  is_black_.clear();
  while (levels_.empty() || (std::min(width, height) > min_side && levels_.size() < max_levels)) {
    levels_.emplace_back(width, height, margin);
    is_black_.emplace_back(static_cast<std::size_t>(height), std::uint8_t{0});
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
}

/// Computes the rows of a level: make_row(y) writes one, or returns true if it is black.
template <class MakeRow>
void Pyramid::build_level(std::size_t level, ThreadPool& threads, const MakeRow& make_row) {
  auto& image = levels_[level];
  auto& is_black = is_black_[level];
  for_each_row(threads, image.height(), [&](int y) {
    auto& was_black = is_black[y];
    const bool black = make_row(y);
    if (black && was_black != 0) return;
    was_black = black ? 1 : 0;
    if (black) std::fill_n(image.row(y), image.width(), std::uint8_t{0});
    reflect_sides(image, y);
    reflect_row(image, y);
  });
}

void Pyramid::build(const ImageView<std::uint8_t>& image, ThreadPool& threads,
                    std::span<const std::uint8_t> is_black) {
  shape(image.width, image.height);
  build_level(0, threads, [&](int y) {
    if (!is_black.empty() && is_black[y] != 0) return true;
    levels_[0].assign_row(y, image.row(y));
    return false;
  });
  for (std::size_t level = 1; level < levels_.size(); ++level) {
    const auto& from = levels_[level - 1];
    const auto& above = is_black_[level - 1];
    build_level(level, threads, [&](int y) {
      bool black = true;
      for (int i = 2 * y - 2; i <= 2 * y + 2; ++i) black &= above[reflected(i, from.height())] != 0;
      if (!black)
        HWY_DYNAMIC_DISPATCH(halve_row)(from, y, levels_[level].row(y), levels_[level].width());
      return black;
    });
  }
}

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
