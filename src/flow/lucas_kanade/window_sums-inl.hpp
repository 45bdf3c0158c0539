// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums over the windows of all blocks of a tile at once. Included once per SIMD target, after
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

/// Pairs of columns, or of rows, of a window.
constexpr int window_pairs = Tile::window / 2;
/// Pairs of columns of a tile's windows, rounded up to whole vectors.
constexpr int column_pairs = 2 * Tile::side;

/// Pairs of columns, one per lane.
using Pairs = hn::CappedTag<std::int32_t, Tile::side>;
using Pair = hn::Vec<Pairs>;
constexpr int pairs_at_once = hn::MaxLanes(Pairs());

#if HWY_TARGET == HWY_SCALAR
template <class A, class B>
HWY_INLINE Pair pair_products(const A* a, const B* b) {
  return hn::Set(Pairs(), a[0] * b[0] + a[1] * b[1]);
}
#else
using PairValues = hn::Repartition<std::int16_t, Pairs>;

HWY_INLINE hn::Vec<PairValues> load_pairs(const std::int16_t* at) {
  return hn::LoadU(PairValues(), at);
}
HWY_INLINE hn::Vec<PairValues> load_pairs(const std::uint8_t* at) {
  return hn::PromoteTo(PairValues(), hn::LoadU(hn::Rebind<std::uint8_t, PairValues>(), at));
}

/// Products of two rows, from these columns on, added up in pairs.
template <class A, class B>
HWY_INLINE Pair pair_products(const A* a, const B* b) {
  auto odd = hn::Zero(Pairs());
  const auto even =
      hn::ReorderWidenMulAccumulate(Pairs(), load_pairs(a), load_pairs(b), hn::Zero(Pairs()), odd);
  return hn::RearrangeToOddPlusEven(even, odd);
}
#endif

/// All pairs of a row.
class PairRow {
 public:
  static constexpr std::size_t size = column_pairs / pairs_at_once;

  /// All 0. Not left to std::array, whose constructor GCC 12 compiles without the target's
  /// instructions.
  PairRow() {
    for (auto& vector : vectors_) vector = hn::Zero(Pairs());
  }
  Pair& operator[](std::size_t i) { return vectors_[i]; }
  const Pair& operator[](std::size_t i) const { return vectors_[i]; }

 private:
  Pair vectors_[size];
};

/// A vector that begins n lanes into `left` and ends in `right`.
template <int n>
HWY_INLINE Pair lanes_from(Pair left, Pair right) {
#if HWY_MAX_BYTES >= 32
  const auto middle = hn::ConcatLowerUpper(Pairs(), right, left);
  if constexpr (n < 4)
    return hn::CombineShiftRightLanes<n>(Pairs(), middle, left);
  else if constexpr (n == 4)
    return middle;
  else
    return hn::CombineShiftRightLanes<n - 4>(Pairs(), right, middle);
#elif HWY_MAX_BYTES == 16
  return hn::CombineShiftRightLanes<n>(Pairs(), right, left);
#else
  return n == 0 ? left : right;
#endif
}

/// Pairs n and up of a row, from its vector `first` on.
template <int n>
HWY_INLINE Pair pairs_from(const PairRow& row, std::size_t first) {
  const auto left = first + n / pairs_at_once;
  if constexpr (n % pairs_at_once == 0) {
    return left < PairRow::size ? row[left] : hn::Zero(Pairs());
  } else {
    return lanes_from<n % pairs_at_once>(
        left < PairRow::size ? row[left] : hn::Zero(Pairs()),
        left + 1 < PairRow::size ? row[left + 1] : hn::Zero(Pairs()));
  }
}

/// A row whose elements are each the sum of itself and the one `n` to its right.
template <int n>
HWY_INLINE PairRow add_pairs(const PairRow& row) {
  PairRow sums;
  for (std::size_t i = 0; i < PairRow::size; ++i) sums[i] = row[i] + pairs_from<n>(row, i);
  return sums;
}

/// Computes `count` sums of products over the window of each block in the first `rows` rows of
/// blocks of a tile. Windows overlap, so rows and columns are summed in pairs first: this takes the
/// time of about two windows summed on their own.
///
/// products(row, column) returns pair_products() in a row of pixels from a column on, both counted
/// from the first pixel of the tile's first window; store(row, column, left, right) takes the sums
/// over the left and the right half of the windows of pairs_at_once blocks.
template <std::size_t count, class Products, class Store>
HWY_INLINE void sum_windows(int rows, const Products& products, const Store& store) {
  const Pairs pairs;
  HWY_ALIGN std::int32_t of_rows[Tile::side + window_pairs - 1][count][column_pairs];
  PairRow sums[count];
  for (int row = 0; row < rows + window_pairs - 1; ++row) {
    for (std::size_t i = 0; i < PairRow::size; ++i) {
      const int pair = static_cast<int>(i) * pairs_at_once;
      const auto upper = products(2 * row, 2 * pair);
      const auto lower = products(2 * row + 1, 2 * pair);
      for (std::size_t k = 0; k < count; ++k) {
        const auto both = upper[k] + lower[k];
        hn::Store(both, pairs, of_rows[row][k] + pair);
        if (row < window_pairs - 1) sums[k][i] = sums[k][i] + both;
      }
    }
  }
  for (int row = 0; row < rows; ++row) {
    PairRow halves[count];
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t i = 0; i < PairRow::size; ++i)
        sums[k][i] =
            sums[k][i] + hn::Load(pairs, of_rows[row + window_pairs - 1][k] + i * pairs_at_once);
      halves[k] = add_pairs<2>(add_pairs<1>(sums[k]));
      for (std::size_t i = 0; i < PairRow::size; ++i)
        sums[k][i] = sums[k][i] - hn::Load(pairs, of_rows[row][k] + i * pairs_at_once);
    }
    for (std::size_t i = 0; i < PairRow::size / 2; ++i) {
      Pair left[count];
      Pair right[count];
      for (std::size_t k = 0; k < count; ++k) {
        left[k] = halves[k][i];
        right[k] = pairs_from<window_pairs / 2>(halves[k], i);
      }
      store(row, static_cast<int>(i) * pairs_at_once, left, right);
    }
  }
}

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
