// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums over the windows of all pixels of a tile at once. Included once per SIMD target, after
// foreach_target.h.
#if defined(EVENTCAMERA_WINDOW_SUMS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_WINDOW_SUMS_INL
#undef EVENTCAMERA_WINDOW_SUMS_INL
#else
#define EVENTCAMERA_WINDOW_SUMS_INL
#endif

#include <cstddef>

#include "src/core/simd-inl.hpp"
#include "src/flow/lucas_kanade/search.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

constexpr int window = Tile::before + Tile::after;
constexpr int tile_pixels = Tile::side * Tile::side;
/// Columns of a tile's windows, rounded up to whole vectors.
constexpr int window_columns = 2 * Tile::side;

/// Minimum eigenvalue of the mean gradient matrix (structure tensor) for a point to be trackable.
constexpr float min_texture = 1e-4F;
/// Scale from gradient products (gradients are in 1/32 of a grey level) to the units of
/// min_texture.
constexpr float slope_product = 1.0F / (1 << 20);

/// Smaller eigenvalue of the mean gradient matrix over a window, from its sums.
template <class Floats, class Value = hn::Vec<Floats>>
HWY_INLINE Value least_eigenvalue(Floats floats, Value xx, Value xy, Value yy) {
  const auto difference = hn::Sub(xx, yy);
  const auto root = hn::Sqrt(
      hn::Add(hn::Mul(difference, difference), hn::Mul(hn::Set(floats, 4.0F), hn::Mul(xy, xy))));
  return hn::Div(hn::Sub(hn::Add(xx, yy), root),
                 hn::Set(floats, static_cast<float>(2 * window * window)));
}

/// Sums over a window of the products of both gradients and the pixels of the other image.
struct GradientSums {
  std::int32_t x;
  std::int32_t y;
};

/// Positions at which a search needs these sums: upper left, upper right, lower left, lower right.
constexpr int corners = 4;

#if HWY_TARGET != HWY_SCALAR
/// In each 128-bit block, lane c is the sum of the lanes of that block of sum c.
template <class Lanes, class Value = hn::Vec<Lanes>>
HWY_INLINE Value add_lanes(Lanes lanes, Value sum0, Value sum1, Value sum2, Value sum3) {
  const hn::Repartition<std::int64_t, Lanes> pairs;
  const auto add_pairs = [&](Value a, Value b) {
    return hn::BitCast(pairs,
                       hn::Add(hn::InterleaveLower(lanes, a, b), hn::InterleaveUpper(lanes, a, b)));
  };
  const auto low = add_pairs(sum0, sum1);
  const auto high = add_pairs(sum2, sum3);
  return hn::Add(hn::BitCast(lanes, hn::InterleaveLower(pairs, low, high)),
                 hn::BitCast(lanes, hn::InterleaveUpper(pairs, low, high)));
}
#endif

/// Neighbouring columns of a row.
using Columns = hn::CappedTag<std::int32_t, 16>;
using Column = hn::Vec<Columns>;
constexpr int columns_at_once = hn::MaxLanes(Columns());

/// All columns of a row.
class WindowRow {
 public:
  static constexpr std::size_t size = window_columns / columns_at_once;

  /// All 0. Not left to std::array, whose constructor GCC 12 compiles without the target's
  /// instructions.
  WindowRow() {
    for (auto& vector : vectors_) vector = hn::Zero(Columns());
  }
  Column& operator[](std::size_t i) { return vectors_[i]; }
  const Column& operator[](std::size_t i) const { return vectors_[i]; }

 private:
  Column vectors_[size];
};

/// A vector that begins n lanes into `left` and ends in `right`.
template <int n>
HWY_INLINE Column lanes_from(Column left, Column right) {
#if HWY_MAX_BYTES == 64
  return Column{_mm512_alignr_epi32(right.raw, left.raw, n)};
#elif HWY_MAX_BYTES == 32
  const auto middle = hn::ConcatLowerUpper(Columns(), right, left);
  if constexpr (n < 4)
    return hn::CombineShiftRightLanes<n>(Columns(), middle, left);
  else if constexpr (n == 4)
    return middle;
  else
    return hn::CombineShiftRightLanes<n - 4>(Columns(), right, middle);
#elif HWY_MAX_BYTES == 16
  return hn::CombineShiftRightLanes<n>(Columns(), right, left);
#else
  return n == 0 ? left : right;
#endif
}

/// Columns n and up of a row, from its vector `first` on.
template <int n>
HWY_INLINE Column columns_from(const WindowRow& row, std::size_t first) {
  const auto left = first + n / columns_at_once;
  if constexpr (n % columns_at_once == 0) {
    return left < WindowRow::size ? row[left] : hn::Zero(Columns());
  } else {
    return lanes_from<n % columns_at_once>(
        left < WindowRow::size ? row[left] : hn::Zero(Columns()),
        left + 1 < WindowRow::size ? row[left + 1] : hn::Zero(Columns()));
  }
}

/// A row whose columns are each the sum of itself and the column `n` to its right.
template <int n>
HWY_INLINE WindowRow add_columns(const WindowRow& row) {
  WindowRow sums;
  for (std::size_t i = 0; i < WindowRow::size; ++i)
    sums[i] = hn::Add(row[i], columns_from<n>(row, i));
  return sums;
}

/// Computes `count` sums of products over the window of each pixel in the first `rows` rows of a
/// tile. Windows overlap, so columns are summed first: this takes the time of about four windows
/// summed on their own.
///
/// products(row, column) returns products of the row and the columns_at_once columns from there on,
/// which count from the first pixel of the tile's first window; store(row, column, left, right)
/// takes the sums over the left 8 and the right 7 columns of the windows of pixels of the tile.
template <std::size_t count, class Products, class Store>
HWY_INLINE void sum_windows(int rows, const Products& products, const Store& store) {
  const Columns columns;
  // All windows include the middle row. The sum of a column is that of its rows down to the middle
  // plus that of the rows below.
  constexpr int middle = window - 1;
  static_assert(Tile::side <= window + 1);
  HWY_ALIGN std::int32_t upper[Tile::side][count][window_columns];
  for (int column = 0; column < window_columns; column += columns_at_once) {
    Column sums[count];
    for (auto& sum : sums) sum = hn::Zero(columns);
    for (int row = Tile::side - 1; row >= 0; --row) {
      if (row <= middle) {
        const auto more = products(row, column);
        for (std::size_t k = 0; k < count; ++k) sums[k] = hn::Add(sums[k], more[k]);
      }
      for (std::size_t k = 0; k < count; ++k) hn::Store(sums[k], columns, upper[row][k] + column);
    }
  }
  WindowRow lower[count];
  for (int row = 0; row < rows; ++row) {
    for (std::size_t i = 0; row > 0 && i < WindowRow::size; ++i) {
      const auto more = products(middle + row, static_cast<int>(i) * columns_at_once);
      for (std::size_t k = 0; k < count; ++k) lower[k][i] = hn::Add(lower[k][i], more[k]);
    }
    WindowRow left[count];
    WindowRow right[count];
    for (std::size_t k = 0; k < count; ++k) {
      WindowRow ones;
      for (std::size_t i = 0; i < WindowRow::size; ++i)
        ones[i] = hn::Add(hn::Load(columns, upper[row][k] + i * columns_at_once), lower[k][i]);
      const auto twos = add_columns<1>(ones);
      const auto fours = add_columns<2>(twos);
      left[k] = add_columns<4>(fours);
      for (std::size_t i = 0; i < WindowRow::size / 2; ++i)
        right[k][i] = hn::Sub(columns_from<8>(left[k], i), columns_from<window>(ones, i));
    }
    for (std::size_t i = 0; i < WindowRow::size / 2; ++i) {
      Column left_sums[count];
      Column right_sums[count];
      for (std::size_t k = 0; k < count; ++k) {
        left_sums[k] = left[k][i];
        right_sums[k] = right[k][i];
      }
      store(row, static_cast<int>(i) * columns_at_once, left_sums, right_sums);
    }
  }
}

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
