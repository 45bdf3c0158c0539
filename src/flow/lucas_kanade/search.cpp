// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/search.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/flow/product_sum-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

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

/// A window row, or part of it if vectors are shorter.
using Values = hn::CappedTag<std::int16_t, 16>;
using Bytes = hn::Rebind<std::uint8_t, Values>;
using Sums = hn::Repartition<std::int32_t, Values>;
using Value = hn::Vec<Values>;
using Sum = hn::Vec<Sums>;

/// One lane per block.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;

constexpr int max_moves = 11;
constexpr float min_move = 0.03F;
/// A search that still moves by more than max_late_move after early_moves does not converge.
constexpr int early_moves = 4;
constexpr float max_late_move = 2.0F;
/// Two successive moves that cancel to within this distance oscillate: the search ends halfway.
constexpr float turning_back = 0.01F;
/// Minimum eigenvalue of the mean gradient matrix (structure tensor) for a block to be trackable.
constexpr float min_texture = 1.6e-4F;
/// Scale from gradient products (gradients are in 1/32 of a grey level) to the units of
/// min_texture.
constexpr float slope_product = 1.0F / (1 << 20);
/// Scale from products of a gradient and a grey value to the same units.
constexpr float mismatch_product = slope_product * 32;
/// Positions at which a search needs sums: upper left, upper right, lower left, lower right.
constexpr int corners = 4;

/// Smaller eigenvalue of the mean gradient matrix over a window, from its sums.
template <class Floats, class Value = hn::Vec<Floats>>
HWY_INLINE Value min_eigenvalue(Floats floats, Value xx, Value xy, Value yy) {
  const auto difference = xx - yy;
  const auto root = hn::Sqrt(difference * difference + hn::Set(floats, 4.0F) * (xy * xy));
  return (xx + yy - root) / hn::Set(floats, static_cast<float>(2 * Tile::window * Tile::window));
}

/// Sums over a window of the products of both gradients and the pixels of the other image.
struct GradientSums {
  std::int32_t x;
  std::int32_t y;
};

/// Calls body(row) for each row of a window, unrolled so that values carried from row to row stay
/// in registers.
template <class Body>
HWY_INLINE void for_each_row(const Body& body) {
  static_assert(Tile::window % 4 == 0);
  for (int row = 0; row < Tile::window; row += 4) {
    body(row);
    body(row + 1);
    body(row + 2);
    body(row + 3);
  }
}

/// Partial sums of a ProductSum that store_parts() writes: one per 128-bit block.
constexpr std::ptrdiff_t parts = hn::MaxLanes(Sums()) == 8 ? 2 : 1;

/// Adds up the lanes of four sums in 128-bit blocks: out[4 * part + k] is a part of sum k.
template <class Factors>
HWY_INLINE void store_parts(const ProductSum<Factors>& sum0, const ProductSum<Factors>& sum1,
                            const ProductSum<Factors>& sum2, const ProductSum<Factors>& sum3,
                            std::int32_t* out) {
#if HWY_TARGET == HWY_SCALAR
  for (const auto* sum : {&sum0, &sum1, &sum2, &sum3}) *out++ = hn::GetLane(sum->lanes());
#else
  const typename ProductSum<Factors>::Lanes lanes;
  hn::Store(add_lanes(lanes, sum0.lanes(), sum1.lanes(), sum2.lanes(), sum3.lanes()), lanes, out);
#endif
}

// A window row of both gradients, and a row of pixels by which both are multiplied.
#if HWY_MAX_BYTES >= 64
using BothValues = hn::FixedTag<std::int16_t, 32>;
using Both = hn::Vec<BothValues>;
using BothSum = ProductSum<BothValues>;

HWY_INLINE Both load_slopes(const std::int16_t* x, const std::int16_t* y) {
  const Values values;
  return hn::Combine(BothValues(), hn::LoadU(values, y), hn::LoadU(values, x));
}

HWY_INLINE Both load_pixels(const std::uint8_t* at) {
  const hn::Rebind<std::uint8_t, BothValues> bytes;
  return hn::PromoteTo(BothValues(), hn::LoadDup128(bytes, at));
}

HWY_INLINE void store_both_parts(const BothSum& sum0, const BothSum& sum1, const BothSum& sum2,
                                 const BothSum& sum3, std::int32_t* out) {
  store_parts(sum0, sum1, sum2, sum3, out);
}
#else
struct Both {
  Value x;
  Value y;
};

HWY_INLINE Both load_slopes(const std::int16_t* x, const std::int16_t* y) {
  return {hn::LoadU(Values(), x), hn::LoadU(Values(), y)};
}

HWY_INLINE Value load_pixels(const std::uint8_t* at) {
  return hn::PromoteTo(Values(), hn::LoadU(Bytes(), at));
}

struct BothSum {
  ProductSum<Values> x;
  ProductSum<Values> y;

  void add(const Both& slopes, Value pixels) {
    x.add(slopes.x, pixels);
    y.add(slopes.y, pixels);
  }
};

HWY_INLINE void store_both_parts(const BothSum& sum0, const BothSum& sum1, const BothSum& sum2,
                                 const BothSum& sum3, std::int32_t* out) {
  store_parts(sum0.x, sum1.x, sum2.x, sum3.x, out);
  store_parts(sum0.y, sum1.y, sum2.y, sum3.y, out + 4 * parts);
}
#endif

/// The windows of a tile's blocks in the first image.
struct Windows {
  const Image<std::uint8_t>& grey;
  const ScharrGradients& gradients;
  int left;  ///< first pixel of the first window
  int top;
  int first_row;  ///< of blocks
  int rows;

  /// Index of a block's window in sums over all of them.
  int index(const Search& search) const { return (search.y - first_row) * Tile::side + search.x; }
};

/// Window sums of all blocks of a tile, at displacements where several blocks search.
///
/// Displacements are in whole pixels; each has an index if it is near the start of the tile's first
/// search. A search needs the sums at four corners: at its displacement, one pixel to the right,
/// one below, and both.
class SharedSums {
 public:
  SharedSums(const Image<std::uint8_t>& to, const Windows& windows, const Flow& start)
      : to_(to),
        windows_(windows),
        first_x_(std::floor(start.x) - before),
        first_y_(std::floor(start.y) - before) {}

  /// Indices of displacements.
  HWY_INLINE hn::Vec<Ints> index(hn::Vec<Floats> x, hn::Vec<Floats> y) const {
    const Floats floats;
    const auto column = x - hn::Set(floats, first_x_);
    const auto row = y - hn::Set(floats, first_y_);
    const auto last = hn::Set(floats, side - 1);
    const auto near = hn::And(hn::And(column >= hn::Zero(floats), column < last),
                              hn::And(row >= hn::Zero(floats), row < last));
    const auto at = row * hn::Set(floats, side) + column;
    return hn::ConvertTo(Ints(), hn::IfThenElse(near, at, hn::Set(floats, far)));
  }

  /// Computes the sums of displacements at which at least `enough` blocks search. Returns false if
  /// there are none.
  bool share(std::span<const std::int32_t> blocks, const std::int32_t* displacement) {
    if (blocks.size() < enough) return false;
    bool any = false;
    for (const auto i : blocks)
      if (++searches_[displacement[i]] == enough && displacement[i] != far)
        any |= compute(displacement[i]);
    for (const auto i : blocks) searches_[displacement[i]] = 0;
    return any;
  }

  bool has(std::int32_t displacement) const { return corners_[displacement][0] != none; }

  /// The sums of a window at corner c of a displacement that it has.
  const GradientSums& at(std::int32_t displacement, int c, int window) const {
    return sums_[corners_[displacement][c] - 1][window];
  }

  /// Number of searches at one displacement from which on summing all windows is faster.
  static constexpr int enough = 5;

 private:
  static constexpr int side = 32;  ///< of the square of displacements that have an index
  /// Pixels of the square on either side of the start.
  static constexpr float before = side / 2.0F;
  static constexpr std::int32_t far = side * side - 1;  ///< index of all other displacements
  static constexpr int max_sums = 64;                   ///< maximum number of corners with sums
  static constexpr std::uint8_t none = 0;

  /// Returns false if max_sums is reached, or a window leaves the image.
  bool compute(std::int32_t displacement) {
    const std::array<std::int32_t, corners> all{displacement, displacement + 1, displacement + side,
                                                displacement + side + 1};
    if (count_ + corners > max_sums || !all_within(displacement)) return false;
    for (std::size_t c = 0; c < all.size(); ++c) {
      auto& number = numbers_[all[c]];
      if (number == none) {
        number = static_cast<std::uint8_t>(++count_);
        sum(all[c], sums_[count_ - 1]);
      }
      corners_[displacement][c] = number;
    }
    return true;
  }

  int left(std::int32_t displacement) const {
    return windows_.left + static_cast<int>(first_x_) + displacement % side;
  }
  int top(std::int32_t displacement) const {
    return windows_.top + static_cast<int>(first_y_) + displacement / side;
  }

  /// True if the rows of the windows at all corners are within the image.
  bool all_within(std::int32_t displacement) const {
    constexpr int lower_corner = 1;
    return top(displacement) >= -to_.margin() &&
           top(displacement) + 2 * (windows_.rows - 1) + Tile::window + lower_corner <=
               to_.height() + to_.margin();
  }

  HWY_NOINLINE void sum(std::int32_t displacement, GradientSums* out) const {
    const auto* pixels = to_.row(top(displacement)) + left(displacement);
    const auto* slope_x = windows_.gradients.x(windows_.top) + windows_.left;
    const auto* slope_y = windows_.gradients.y(windows_.top) + windows_.left;
    sum_windows<2>(
        windows_.rows,
        [&](int row, int column) {
          const auto* there = pixels + row * to_.stride() + column;
          const auto at = row * windows_.gradients.stride() + column;
          return std::array<Pair, 2>{pair_products(slope_x + at, there),
                                     pair_products(slope_y + at, there)};
        },
        [&](int row, int column, const auto& left, const auto& right) {
          hn::StoreInterleaved2(left[0] + right[0], left[1] + right[1], Pairs(),
                                &out[row * Tile::side + column].x);
        });
  }

  const Image<std::uint8_t>& to_;
  const Windows& windows_;
  float first_x_;  ///< displacement of index 0
  float first_y_;
  int count_ = 0;
  std::uint8_t searches_[side * side] = {};  ///< all 0 between calls of share()
  /// Number of the sums at a displacement, counted from 1.
  std::uint8_t numbers_[side * side] = {};
  std::uint8_t corners_[side * side][corners] = {};
  HWY_ALIGN GradientSums sums_[max_sums][Tile::block_count];
};

/// Searches for the blocks of a tile, one lane per block.
class Blocks {
 public:
  Blocks(const Image<std::uint8_t>& to, const Tile& tile, std::span<const Search> searches,
         const Windows& windows)
      : to_(to), windows_(windows), count_(static_cast<int>(searches.size())) {
    for (int i = 0; i < count_; ++i) {
      const auto& search = searches[i];
      window_[i] = windows.index(search);
      left_[i] = static_cast<float>(windows.left + 2 * search.x);
      top_[i] = static_cast<float>(tile.top - Tile::before + 2 * search.y);
      flow_x_[i] = search.flow.x;
      flow_y_[i] = search.flow.y;
      before_x_[i] = before_y_[i] = 0;
      cell_x_[i] = cell_y_[i] = std::numeric_limits<float>::max();
    }
    if (count_ >= SharedSums::enough) shared_.emplace(to, windows, searches.front().flow);
    sum_windows_here();
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; i += lanes) {
      const auto scale = hn::Set(floats, slope_product);
      const auto xx = hn::Load(floats, xx_ + i) * scale;
      const auto xy = hn::Load(floats, xy_ + i) * scale;
      const auto yy = hn::Load(floats, yy_ + i) * scale;
      const auto determinant = xx * yy - xy * xy;
      const auto followed =
          hn::And(min_eigenvalue(floats, xx, xy, yy) >= hn::Set(floats, min_texture),
                  determinant >= hn::Set(floats, std::numeric_limits<float>::epsilon()));
      const auto present =
          hn::FirstN(floats, static_cast<std::size_t>(std::min(lanes, count_ - i)));
      hn::Store(xx, floats, xx_ + i);
      hn::Store(xy, floats, xy_ + i);
      hn::Store(yy, floats, yy_ + i);
      hn::Store(hn::Set(floats, 1.0F) / determinant, floats, inverse_ + i);
      const auto ones = hn::IfThenElseZero(hn::And(followed, present), hn::Set(floats, 1.0F));
      hn::Store(ones, floats, followed_ + i);
      hn::Store(ones, floats, active_ + i);
    }
  }

  void search() {
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; i += lanes) {
      const auto active = hn::Load(floats, active_ + i) != hn::Zero(floats);
      locate(i, active, hn::Load(floats, flow_x_ + i), hn::Load(floats, flow_y_ + i));
    }
    for (int round = 0; round < max_moves; ++round) {
      update_sums();
      bool any = false;
      for (int i = 0; i < count_; i += lanes) {
        const auto active = hn::Load(floats, active_ + i) != hn::Zero(floats);
        if (hn::AllFalse(floats, active)) continue;
        any = true;
        move(i, active, round);
      }
      if (!any) break;
    }
  }

  void store(std::span<Search> searches) const {
    for (int i = 0; i < count_; ++i) {
      auto& search = searches[i];
      const float x = left_[i] + std::floor(flow_x_[i]);
      const float y = top_[i] + std::floor(flow_y_[i]);
      search.found = followed_[i] != 0 && x >= -Tile::window && y >= -Tile::window &&
                     x < static_cast<float>(to_.width()) && y < static_cast<float>(to_.height());
      if (search.found) search.flow = {flow_x_[i], flow_y_[i]};
    }
  }

 private:
  static constexpr int capacity = Tile::block_count;

  /// Computes the sums over the blocks' windows that stay constant during their searches.
  void sum_windows_here() {
    enum { xx, yy, grey_x, grey_y, xy, xy_right };
    HWY_ALIGN std::int32_t sums[6][capacity];
    const auto* grey = windows_.grey.row(windows_.top) + windows_.left;
    const auto* slope_x = windows_.gradients.x(windows_.top) + windows_.left;
    const auto* slope_y = windows_.gradients.y(windows_.top) + windows_.left;
    sum_windows<5>(
        windows_.rows,
        [&](int row, int column) {
          const auto* here = grey + row * windows_.grey.stride() + column;
          const auto* dx = slope_x + row * windows_.gradients.stride() + column;
          const auto* dy = slope_y + row * windows_.gradients.stride() + column;
          return std::array<Pair, 5>{pair_products(dx, dx), pair_products(dy, dy),
                                     pair_products(dx, here), pair_products(dy, here),
                                     pair_products(dx, dy)};
        },
        [&](int row, int column, const auto& left, const auto& right) {
          const Pairs pairs;
          const int at = row * Tile::side + column;
          for (std::size_t k = 0; k < xy; ++k) hn::Store(left[k] + right[k], pairs, sums[k] + at);
          hn::Store(left[xy], pairs, sums[xy] + at);
          hn::Store(right[xy], pairs, sums[xy_right] + at);
        });
    for (int i = 0; i < count_; ++i) {
      const int at = window_[i];
      // Gradients are at most 4080, so squares need 32 bits without a sign, and products 33 with
      // it.
      xx_[i] = static_cast<float>(static_cast<std::uint32_t>(sums[xx][at]));
      xy_[i] = static_cast<float>(std::int64_t{sums[xy][at]} + sums[xy_right][at]);
      yy_[i] = static_cast<float>(static_cast<std::uint32_t>(sums[yy][at]));
      here_x_[i] = sums[grey_x][at];
      here_y_[i] = sums[grey_y][at];
    }
  }

  /// Updates the sums of gradient * there of blocks that entered another pixel.
  void update_sums() {
    if (shared_) {
      use_shared_sums();
      if (shared_->share(moved(), displacement_)) use_shared_sums();
    }
    for (const auto i : moved()) sum_around(i);
    moved_count_ = 0;
  }

  std::span<const std::int32_t> moved() const { return std::span(moved_).first(moved_count_); }

  /// Removes blocks whose displacement has shared sums from moved_, and copies their sums.
  void use_shared_sums() {
    std::int32_t taken[capacity];
    int taken_count = 0;
    int left = 0;
    for (const auto i : moved()) {  // without a branch, which would be mispredicted often
      const bool has = shared_->has(displacement_[i]);
      taken[taken_count] = i;
      moved_[left] = i;
      taken_count += has ? 1 : 0;
      left += has ? 0 : 1;
    }
    moved_count_ = left;
    for (int k = 0; k < taken_count; ++k) {
      const int i = taken[k];
      for (int c = 0; c < corners; ++c) there_[c][i] = shared_->at(displacement_[i], c, window_[i]);
    }
  }

  /// Computes the sums of gradient * there with the window at each of the four pixels around its
  /// position in the other image.
  void sum_around(int i) {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    const auto stride = to_.stride();
    BothSum upper_left;
    BothSum upper_right;
    BothSum lower_left;
    BothSum lower_right;
    const int block_x = 2 * (window_[i] % Tile::side);
    const int block_y = 2 * (window_[i] / Tile::side);
    for (int column = 0; column < Tile::window; column += lanes) {
      const auto begin = windows_.left + block_x + column;
      const auto* slope_x = windows_.gradients.x(windows_.top + block_y) + begin;
      const auto* slope_y = windows_.gradients.y(windows_.top + block_y) + begin;
      const auto* pixels = to_.row(0) + at_[i] + column;
      auto left = load_pixels(pixels);
      auto right = load_pixels(pixels + 1);
      for_each_row([&](int) {
        const auto slopes = load_slopes(slope_x, slope_y);
        slope_x += windows_.gradients.stride();
        slope_y += windows_.gradients.stride();
        upper_left.add(slopes, left);
        upper_right.add(slopes, right);
        pixels += stride;
        left = load_pixels(pixels);
        right = load_pixels(pixels + 1);
        lower_left.add(slopes, left);
        lower_right.add(slopes, right);
      });
    }
    HWY_ALIGN std::int32_t part[2 * parts * 4];
    store_both_parts(upper_left, upper_right, lower_left, lower_right, part);
    for (std::ptrdiff_t c = 0; c < corners; ++c) {
      auto& sums = there_[c][i];
      sums = {part[c], part[4 * parts + c]};
      if (parts == 2) {
        sums.x += part[4 + c];
        sums.y += part[4 * parts + 4 + c];
      }
    }
  }

  /// Stores the pixels that blocks are in, queues blocks that entered another pixel in moved_, and
  /// deactivates blocks that left the image.
  template <class Mask>
  void locate(int i, Mask active, hn::Vec<Floats> flow_x, hn::Vec<Floats> flow_y) {
    const Floats floats;
    const auto cell_x = hn::Floor(flow_x);
    const auto cell_y = hn::Floor(flow_y);
    const auto x = cell_x + hn::Load(floats, left_ + i);
    const auto y = cell_y + hn::Load(floats, top_ + i);
    const auto min = hn::Set(floats, -static_cast<float>(Tile::window));
    const auto inside =
        hn::And(hn::And(x >= min, x < hn::Set(floats, static_cast<float>(to_.width()))),
                hn::And(y >= min, y < hn::Set(floats, static_cast<float>(to_.height()))));
    active = hn::And(active, inside);
    const Ints ints;
    const auto stride = hn::Set(ints, static_cast<std::int32_t>(to_.stride()));
    const auto row = hn::ConvertTo(ints, hn::IfThenElseZero(inside, y));
    const auto column = hn::ConvertTo(ints, hn::IfThenElseZero(inside, x));
    hn::Store(row * stride + column, ints, at_ + i);
    if (shared_) hn::Store(shared_->index(cell_x, cell_y), ints, displacement_ + i);
    const auto moved = hn::And(active, hn::Or(cell_x != hn::Load(floats, cell_x_ + i),
                                              cell_y != hn::Load(floats, cell_y_ + i)));
    hn::Store(cell_x, floats, cell_x_ + i);
    hn::Store(cell_y, floats, cell_y_ + i);
    hn::Store(hn::IfThenElseZero(active, hn::Set(floats, 1.0F)), floats, active_ + i);
    // A whole vector fits, because at most i are queued.
    const FirstLanes<decltype(ints)> first_lanes(hn::RebindMask(ints, moved));
    hn::StoreU(first_lanes(iota(ints, i)), ints, moved_ + moved_count_);
    moved_count_ += static_cast<int>(hn::CountTrue(floats, moved));
  }

  /// Moves a vector of blocks by one Gauss-Newton step.
  template <class Mask>
  void move(int i, Mask active, int round) {
    const Floats floats;
    const Ints ints;
    const auto flow_x = hn::Load(floats, flow_x_ + i);
    const auto flow_y = hn::Load(floats, flow_y_ + i);
    const auto beyond_x = flow_x - hn::Load(floats, cell_x_ + i);
    const auto beyond_y = flow_y - hn::Load(floats, cell_y_ + i);
    // Sums of gradient * (there - here).
    hn::Vec<Floats> mismatch_x[corners];
    hn::Vec<Floats> mismatch_y[corners];
    for (int c = 0; c < corners; ++c) {
      hn::Vec<Ints> there_x;
      hn::Vec<Ints> there_y;
      hn::LoadInterleaved2(ints, &there_[c][i].x, there_x, there_y);
      const auto subtract = [&](auto there, const std::int32_t* here) {
        return hn::ConvertTo(floats, there - hn::Load(ints, here + i));
      };
      mismatch_x[c] = subtract(there_x, here_x_);
      mismatch_y[c] = subtract(there_y, here_y_);
    }
    const auto bilinear = [&](const auto& at) {
      return lerp(lerp(at[0], at[1], beyond_x), lerp(at[2], at[3], beyond_x), beyond_y) *
             hn::Set(floats, mismatch_product);
    };
    const auto x = bilinear(mismatch_x);
    const auto y = bilinear(mismatch_y);
    const auto xx = hn::Load(floats, xx_ + i);
    const auto xy = hn::Load(floats, xy_ + i);
    const auto yy = hn::Load(floats, yy_ + i);
    const auto inverse = hn::Load(floats, inverse_ + i);
    const auto move_x = (xy * y - yy * x) * inverse;
    const auto move_y = (xy * x - xx * y) * inverse;
    auto to_x = flow_x + move_x;
    auto to_y = flow_y + move_y;
    const auto square = move_x * move_x + move_y * move_y;
    auto stops = square <= hn::Set(floats, min_move * min_move);
    if (round >= early_moves)
      stops = hn::Or(stops, square > hn::Set(floats, max_late_move * max_late_move));
    if (round > 0) {
      const auto limit = hn::Set(floats, turning_back);
      const auto turns =
          hn::AndNot(stops, hn::And(hn::Abs(move_x + hn::Load(floats, before_x_ + i)) < limit,
                                    hn::Abs(move_y + hn::Load(floats, before_y_ + i)) < limit));
      const auto half = hn::Set(floats, 0.5F);
      to_x = hn::IfThenElse(turns, to_x - move_x * half, to_x);
      to_y = hn::IfThenElse(turns, to_y - move_y * half, to_y);
      stops = hn::Or(stops, turns);
    }
    to_x = hn::IfThenElse(active, to_x, flow_x);
    to_y = hn::IfThenElse(active, to_y, flow_y);
    hn::Store(to_x, floats, flow_x_ + i);
    hn::Store(to_y, floats, flow_y_ + i);
    hn::Store(move_x, floats, before_x_ + i);
    hn::Store(move_y, floats, before_y_ + i);
    locate(i, hn::AndNot(stops, active), to_x, to_y);
  }

  const Image<std::uint8_t>& to_;
  const Windows& windows_;
  std::optional<SharedSums> shared_;  ///< if there are several blocks
  int count_;
  int moved_count_ = 0;
  int window_[capacity];  ///< index of its window
  HWY_ALIGN float left_[capacity];
  HWY_ALIGN float top_[capacity];
  HWY_ALIGN float flow_x_[capacity];
  HWY_ALIGN float flow_y_[capacity];
  HWY_ALIGN float before_x_[capacity];
  HWY_ALIGN float before_y_[capacity];
  HWY_ALIGN float xx_[capacity];
  HWY_ALIGN float xy_[capacity];
  HWY_ALIGN float yy_[capacity];
  HWY_ALIGN float inverse_[capacity];
  HWY_ALIGN float followed_[capacity];
  HWY_ALIGN float active_[capacity];
  HWY_ALIGN float cell_x_[capacity];
  HWY_ALIGN float cell_y_[capacity];
  HWY_ALIGN std::int32_t at_[capacity];  ///< offset of the window in the other image
  HWY_ALIGN std::int32_t displacement_[capacity];
  HWY_ALIGN std::int32_t here_x_[capacity];
  HWY_ALIGN std::int32_t here_y_[capacity];
  /// Sums with the window at each of the four pixels around its position: upper left, upper right,
  /// lower left and lower right.
  HWY_ALIGN GradientSums there_[corners][capacity];
  std::int32_t moved_[capacity];
};

void search_all(const Image<std::uint8_t>& from, const ScharrGradients& gradients,
                const Image<std::uint8_t>& to, const Tile& tile, std::span<Search> searches) {
  const int first = searches.front().y;
  const int last = searches.back().y;
  const Windows windows{
      from,  gradients,       tile.left - Tile::before, tile.top + 2 * first - Tile::before,
      first, last - first + 1};
  Blocks blocks(to, tile, searches, windows);
  blocks.search();
  blocks.store(searches);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(search_all);

void search_tile(const Image<std::uint8_t>& from, const ScharrGradients& gradients,
                 const Image<std::uint8_t>& to, const Tile& tile, std::span<Search> searches) {
  HWY_DYNAMIC_DISPATCH(search_all)(from, gradients, to, tile, searches);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
