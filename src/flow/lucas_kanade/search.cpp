// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/lucas_kanade/search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/lucas_kanade/search.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/flow/lucas_kanade/byte_windows-inl.hpp"
#include "src/flow/lucas_kanade/window_sums-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// A window row, or part of it if vectors are shorter.
using Values = hn::CappedTag<std::int16_t, 16>;
using Bytes = hn::Rebind<std::uint8_t, Values>;
using Sums = hn::Repartition<std::int32_t, Values>;
using Value = hn::Vec<Values>;
using Sum = hn::Vec<Sums>;

/// One lane per point.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;

/// A window row is processed as 16 values; the last one has weight 0.
constexpr int row_values = 16;
constexpr int max_moves = 10;
constexpr float min_move = 0.03F;
/// Two successive moves that cancel to within this distance oscillate: the search ends halfway.
constexpr float turning_back = 0.01F;
/// Scale from products of a gradient and a grey value (in 1/4 of a grey level) to the same units.
constexpr float mismatch_product = slope_product * 8;

/// Calls body(row) for each row of a window, unrolled so that values carried from row to row stay
/// in registers.
template <class Body>
HWY_INLINE void for_each_row(const Body& body) {
  static_assert(window % 5 == 0);
  for (int row = 0; row < window; row += 5) {
    body(row);
    body(row + 1);
    body(row + 2);
    body(row + 3);
    body(row + 4);
  }
}

/// The part of the first image covered by the windows of a tile's points, resampled bilinearly at
/// the sub-pixel offset that the points share.
class Patch {
 public:
  static constexpr int stride = window_columns;

  /// Covers points in rows first_row ... last_row of the tile.
  Patch(const Image<std::uint8_t>& picture, const ScharrGradients& gradients, const Tile& tile,
        int first_row, int last_row)
      : left_(tile.left - Tile::before),
        top_(tile.top + first_row - Tile::before),
        first_row_(first_row),
        rows_(last_row - first_row + 1) {
    const int rows = last_row - first_row + window;
    const int x = left_;
    const int y = top_;
    const Values values;
    const auto load_grey = [&](int row, int column) {
      const auto* at = picture.row(y + row) + x + column;
      return hn::ShiftLeft<2>(hn::PromoteTo(values, hn::LoadU(Bytes(), at)));
    };
    const auto load_x = [&](int row, int column) {
      return hn::LoadU(values, gradients.x(y + row) + x + column);
    };
    const auto load_y = [&](int row, int column) {
      return hn::LoadU(values, gradients.y(y + row) + x + column);
    };
    interpolate(tile, rows, load_grey, grey_);
    interpolate(tile, rows, load_x, slope_x_);
    interpolate(tile, rows, load_y, slope_y_);
  }

  /// Position of the first value.
  int left() const { return left_; }
  int top() const { return top_; }
  /// Rows of points.
  int rows() const { return rows_; }
  /// Index of the first value of a point's window; its rows are `stride` values apart.
  int index(int x, int y) const { return (y - first_row_) * stride + x; }
  /// Index of a point among the pixels of the tile from the first row of points on.
  int pixel(int x, int y) const { return (y - first_row_) * Tile::side + x; }
  const std::int16_t* grey() const { return grey_; }
  const std::int16_t* slope_x() const { return slope_x_; }
  const std::int16_t* slope_y() const { return slope_y_; }

 private:
  static constexpr int max_values = (Tile::side + window) * stride;

  template <class Load>
  static void interpolate(const Tile& tile, int rows, const Load& load, std::int16_t* out) {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    constexpr int fraction = (1 << 15) / Tile::fractions;
    const auto right = hn::Set(values, static_cast<std::int16_t>(tile.right * fraction));
    const auto down = hn::Set(values, static_cast<std::int16_t>(tile.down * fraction));
    const auto between = [](Value a, Value b, Value part) {
      return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), part));
    };
    for (int column = 0; column < stride; column += lanes) {
      const auto across = [&](int row) {
        return between(load(row, column), load(row, column + 1), right);
      };
      auto upper = across(0);
      for (int row = 0; row < rows; ++row) {
        const auto lower = across(row + 1);
        hn::Store(between(upper, lower, down), values, out + std::ptrdiff_t{row} * stride + column);
        upper = lower;
      }
    }
  }

  HWY_ALIGN std::int16_t grey_[max_values];
  HWY_ALIGN std::int16_t slope_x_[max_values];
  HWY_ALIGN std::int16_t slope_y_[max_values];
  int left_;
  int top_;
  int first_row_;
  int rows_;
};

/// Lane-wise sum of the products of two columns of vectors. 32 bits hold 15 of the largest
/// products.
template <class Factors = Values>
class ProductSum {
 public:
  using Factor = hn::Vec<Factors>;
  using Lanes = hn::Repartition<std::int32_t, Factors>;

  // Not defaulted: GCC 12 compiles a defaulted constructor without the target's instructions.
  ProductSum() : low_(hn::Zero(Lanes())), high_(hn::Zero(Lanes())) {}
  void add(Factor a, Factor b) { low_ = hn::ReorderWidenMulAccumulate(Lanes(), a, b, low_, high_); }
  hn::Vec<Lanes> lanes() const { return hn::Add(low_, high_); }

 private:
  hn::Vec<Lanes> low_;
  hn::Vec<Lanes> high_;
};

/// Partial sums per ProductSum in the output of store_parts(): one per 128-bit block.
constexpr std::ptrdiff_t parts = hn::MaxLanes(Sums()) == 8 ? 2 : 1;

/// Reduces the lanes of four sums within 128-bit blocks: out[4 * part + k] is a partial sum of sum
/// k.
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

// A window row of both gradients, and a row of pixels to multiply both with.
#if HWY_MAX_BYTES >= 64
using BothValues = hn::FixedTag<std::int16_t, 32>;
using Both = hn::Vec<BothValues>;
using BothSum = ProductSum<BothValues>;

HWY_INLINE Both load_slopes(const std::int16_t* x, const std::int16_t* y, Value weight) {
  const Values values;
  return hn::And(hn::Combine(BothValues(), hn::LoadU(values, y), hn::LoadU(values, x)),
                 hn::Combine(BothValues(), weight, weight));
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

HWY_INLINE Both load_slopes(const std::int16_t* x, const std::int16_t* y, Value weight) {
  const Values values;
  return {hn::And(hn::LoadU(values, x), weight), hn::And(hn::LoadU(values, y), weight)};
}

HWY_INLINE Value load_pixels(const std::uint8_t* at) {
  return hn::PromoteTo(Values(), hn::LoadU(Bytes(), at));
}

struct BothSum {
  ProductSum<> x;
  ProductSum<> y;

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

/// Sums of the windows of all pixels of a tile, moved by displacements where many points search.
///
/// Displacements are in whole pixels, and have an index of their own if they are near the start of
/// the tile's first search. A search needs the sums at four corners: its displacement, and those
/// one pixel to the right, one below, and both.
class SharedSums {
 public:
  SharedSums(const Image<std::uint8_t>& to, const Patch& patch, const Flow& start)
      : to_(to),
        patch_(patch),
        first_x_(std::floor(start.x) - before),
        first_y_(std::floor(start.y) - before) {}

  /// Indices of displacements.
  HWY_INLINE hn::Vec<Ints> index(hn::Vec<Floats> x, hn::Vec<Floats> y) const {
    const Floats floats;
    const auto column = hn::Sub(x, hn::Set(floats, first_x_));
    const auto row = hn::Sub(y, hn::Set(floats, first_y_));
    const auto last = hn::Set(floats, side - 1);
    const auto near = hn::And(hn::And(hn::Ge(column, hn::Zero(floats)), hn::Lt(column, last)),
                              hn::And(hn::Ge(row, hn::Zero(floats)), hn::Lt(row, last)));
    const auto at = hn::Add(hn::Mul(row, hn::Set(floats, side)), column);
    return hn::ConvertTo(Ints(), hn::IfThenElse(near, at, hn::Set(floats, far)));
  }

  /// Computes the sums of displacements at which enough of the points search. False if there are
  /// none.
  bool share(std::span<const std::int32_t> points, const std::int32_t* displacement) {
    if (points.size() < enough) return false;
    bool any = false;
    for (const auto i : points)
      if (++searches_[displacement[i]] == enough && displacement[i] != far)
        any |= compute(displacement[i]);
    for (const auto i : points) searches_[displacement[i]] = 0;
    return any;
  }

  bool has(std::int32_t displacement) const { return corners_[displacement][0] != none; }

  /// The sums of a pixel at corner c of a displacement that it has.
  const GradientSums& at(std::int32_t displacement, int c, int pixel) const {
    return sums_[corners_[displacement][c] - 1][pixel];
  }

 private:
  static constexpr int side = 32;  ///< of the square of displacements that have an index
  static constexpr float before =
      side / 2.0F;  ///< pixels of the square on either side of the start
  static constexpr std::int32_t far = side * side - 1;  ///< index of all other displacements
  static constexpr int max_sums = 64;                   ///< maximum number of corners with sums
  /// Number of searches at one displacement that take longer than the sums of all pixels.
  static constexpr int enough = 18;
  static constexpr std::uint8_t none = 0;

  /// Returns false if there is no memory left for them, or a window leaves the image.
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
    return patch_.left() + static_cast<int>(first_x_) + displacement % side;
  }
  int top(std::int32_t displacement) const {
    return patch_.top() + static_cast<int>(first_y_) + displacement / side;
  }

  /// True if the rows of the windows at all corners are within the image.
  bool all_within(std::int32_t displacement) const {
    return top(displacement) >= -to_.margin() &&
           top(displacement) + patch_.rows() + window <= to_.height() + to_.margin();
  }

  HWY_NOINLINE void sum(std::int32_t displacement, GradientSums* out) const {
    const Columns columns;
    const hn::Rebind<std::int16_t, Columns> slopes;
    const hn::Rebind<std::uint8_t, Columns> bytes;
    const int x = left(displacement);
    const int y = top(displacement);
    sum_windows<2>(
        patch_.rows(),
        [&](int row, int column) {
          const int at = row * Patch::stride + column;
          const auto pixels =
              hn::PromoteTo(columns, hn::LoadU(bytes, to_.row(y + row) + x + column));
          const auto dx = hn::PromoteTo(columns, hn::Load(slopes, patch_.slope_x() + at));
          const auto dy = hn::PromoteTo(columns, hn::Load(slopes, patch_.slope_y() + at));
          return std::array<Column, 2>{hn::Mul(dx, pixels), hn::Mul(dy, pixels)};
        },
        [&](int row, int column, const auto& left, const auto& right) {
          hn::StoreInterleaved2(hn::Add(left[0], right[0]), hn::Add(left[1], right[1]), columns,
                                &out[row * Tile::side + column].x);
        });
  }

  const Image<std::uint8_t>& to_;
  const Patch& patch_;
  float first_x_;  ///< displacement of index 0
  float first_y_;
  int count_ = 0;
  std::uint16_t searches_[side * side] = {};  ///< all 0 between calls of share()
  /// Number of the sums at a displacement, counted from 1.
  std::uint8_t numbers_[side * side] = {};
  std::uint8_t corners_[side * side][corners] = {};
  HWY_ALIGN GradientSums sums_[max_sums][tile_pixels];
};

/// Searches for the points of a tile, one lane per point.
class Points {
 public:
  Points(const Image<std::uint8_t>& to, const Tile& tile, std::span<const Search> searches,
         const Patch& patch)
      : to_(to),
        patch_(patch),
        count_(static_cast<int>(searches.size())),
        right_(static_cast<float>(tile.right) / Tile::fractions),
        down_(static_cast<float>(tile.down) / Tile::fractions) {
    for (int i = 0; i < count_; ++i) {
      const auto& search = searches[static_cast<std::size_t>(i)];
      window_[i] = patch.index(search.x, search.y);
      pixel_[i] = patch.pixel(search.x, search.y);
      left_[i] = static_cast<float>(tile.left + search.x - Tile::before);
      top_[i] = static_cast<float>(tile.top + search.y - Tile::before);
      flow_x_[i] = search.flow.x;
      flow_y_[i] = search.flow.y;
      before_x_[i] = before_y_[i] = 0;
      cell_x_[i] = cell_y_[i] = std::numeric_limits<float>::max();
    }
    if (count_ < share_from) {
      for (int i = 0; i < count_; ++i) sum_window(i);
    } else {
      sum_all_windows();
      shared_.emplace(to, patch, searches.front().flow);
    }
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; i += lanes) {
      const auto scale = hn::Set(floats, slope_product);
      const auto xx = hn::Mul(hn::Load(floats, xx_ + i), scale);
      const auto xy = hn::Mul(hn::Load(floats, xy_ + i), scale);
      const auto yy = hn::Mul(hn::Load(floats, yy_ + i), scale);
      const auto determinant = hn::Sub(hn::Mul(xx, yy), hn::Mul(xy, xy));
      const auto followed =
          hn::And(hn::Ge(least_eigenvalue(floats, xx, xy, yy), hn::Set(floats, min_texture)),
                  hn::Ge(determinant, hn::Set(floats, std::numeric_limits<float>::epsilon())));
      const auto present =
          hn::FirstN(floats, static_cast<std::size_t>(std::min(lanes, count_ - i)));
      hn::Store(xx, floats, xx_ + i);
      hn::Store(xy, floats, xy_ + i);
      hn::Store(yy, floats, yy_ + i);
      hn::Store(hn::Div(hn::Set(floats, 1.0F), determinant), floats, inverse_ + i);
      const auto ones = hn::IfThenElseZero(hn::And(followed, present), hn::Set(floats, 1.0F));
      hn::Store(ones, floats, followed_ + i);
      hn::Store(ones, floats, active_ + i);
    }
  }

  void search() {
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; i += lanes) {
      const auto active = hn::Ne(hn::Load(floats, active_ + i), hn::Zero(floats));
      locate(i, active, hn::Load(floats, flow_x_ + i), hn::Load(floats, flow_y_ + i));
    }
    for (int round = 0; round < max_moves; ++round) {
      look();
      bool any = false;
      for (int i = 0; i < count_; i += lanes) {
        const auto active = hn::Ne(hn::Load(floats, active_ + i), hn::Zero(floats));
        if (hn::AllFalse(floats, active)) continue;
        any = true;
        move(i, active, round > 0);
      }
      if (!any) break;
    }
  }

  void store(std::span<Search> searches) const {
    for (int i = 0; i < count_; ++i) {
      auto& search = searches[static_cast<std::size_t>(i)];
      search.flow = {flow_x_[i], flow_y_[i]};
      const float x = left_[i] + std::floor(right_ + flow_x_[i]);
      const float y = top_[i] + std::floor(down_ + flow_y_[i]);
      search.found = followed_[i] != 0 && x >= -window && y >= -window &&
                     x < static_cast<float>(to_.width()) && y < static_cast<float>(to_.height());
    }
  }

 private:
  static constexpr int capacity = tile_pixels;
  /// Number of points that take longer one by one than the sums of all pixels.
  static constexpr int share_from = 12;

  /// Computes the sums over a point's window that stay constant during its search.
  void sum_window(int i) {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    std::int64_t sums[8] = {};
    for (int column = 0; column < row_values; column += lanes) {
      const int begin = window_[i] + column;
      const auto within = weights(column);
      ProductSum xx;
      ProductSum xy;
      ProductSum yy;
      ProductSum grey_x;
      ProductSum grey_y;
      for_each_row([&](int row) {
        const int at = begin + row * Patch::stride;
        const auto dx = hn::And(hn::LoadU(values, patch_.slope_x() + at), within);
        const auto dy = hn::And(hn::LoadU(values, patch_.slope_y() + at), within);
        const auto grey = hn::LoadU(values, patch_.grey() + at);
        xx.add(dx, dx);
        xy.add(dx, dy);
        yy.add(dy, dy);
        grey_x.add(dx, grey);
        grey_y.add(dy, grey);
      });
      HWY_ALIGN std::int32_t part[2 * parts * 4];
      store_parts(xx, xy, yy, yy, part);
      store_parts(grey_x, grey_y, grey_x, grey_y, part + 4 * parts);
      for (int k = 0; k < 4; ++k) {
        for (std::ptrdiff_t p = 0; p < parts; ++p) {
          sums[k] += part[4 * p + k];
          sums[4 + k] += part[4 * (parts + p) + k];
        }
      }
    }
    xx_[i] = static_cast<float>(sums[0]);
    xy_[i] = static_cast<float>(sums[1]);
    yy_[i] = static_cast<float>(sums[2]);
    here_x_[i] = static_cast<std::int32_t>(sums[4]);
    here_y_[i] = static_cast<std::int32_t>(sums[5]);
  }

  /// The same for all points, from the sums of all pixels of the tile.
  void sum_all_windows() {
    const Columns columns;
    const hn::Rebind<std::int16_t, Columns> values;
    enum { xx, yy, grey_x, grey_y, xy, xy_right };
    HWY_ALIGN std::int32_t sums[6][capacity];
    sum_windows<5>(
        patch_.rows(),
        [&](int row, int column) {
          const int at = row * Patch::stride + column;
          const auto dx = hn::PromoteTo(columns, hn::Load(values, patch_.slope_x() + at));
          const auto dy = hn::PromoteTo(columns, hn::Load(values, patch_.slope_y() + at));
          const auto grey = hn::PromoteTo(columns, hn::Load(values, patch_.grey() + at));
          return std::array<Column, 5>{hn::Mul(dx, dx), hn::Mul(dy, dy), hn::Mul(dx, grey),
                                       hn::Mul(dy, grey), hn::Mul(dx, dy)};
        },
        [&](int row, int column, const auto& left, const auto& right) {
          const int at = row * Tile::side + column;
          for (std::size_t k = 0; k < xy; ++k)
            hn::Store(hn::Add(left[k], right[k]), columns, sums[k] + at);
          hn::Store(left[xy], columns, sums[xy] + at);
          hn::Store(right[xy], columns, sums[xy_right] + at);
        });
    for (int i = 0; i < count_; ++i) {
      const int at = pixel_[i];
      // Gradients are at most 4080, so squares need 32 bits without a sign, and products 33 with
      // it.
      xx_[i] = static_cast<float>(static_cast<std::uint32_t>(sums[xx][at]));
      xy_[i] = static_cast<float>(std::int64_t{sums[xy][at]} + sums[xy_right][at]);
      yy_[i] = static_cast<float>(static_cast<std::uint32_t>(sums[yy][at]));
      here_x_[i] = sums[grey_x][at];
      here_y_[i] = sums[grey_y][at];
    }
  }

  /// Mask of a window row: all bits set, except in the last of the 16 values.
  static Value weights(int column) {
    HWY_ALIGN static constexpr std::int16_t weight[row_values] = {-1, -1, -1, -1, -1, -1, -1, -1,
                                                                  -1, -1, -1, -1, -1, -1, -1, 0};
    return hn::Load(Values(), weight + column);
  }

  /// Gets the sums of gradient * there of points that entered another pixel.
  void look() {
    if (shared_) {
      take_shared();
      if (shared_->share(moved(), displacement_)) take_shared();
    }
    look_alone();
    moved_count_ = 0;
  }

  std::span<const std::int32_t> moved() const {
    return std::span(moved_).first(static_cast<std::size_t>(moved_count_));
  }

  /// Takes points whose displacement has shared sums out of moved_, and copies their sums.
  void take_shared() {
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
      for (int c = 0; c < corners; ++c) there_[c][i] = shared_->at(displacement_[i], c, pixel_[i]);
    }
  }

  /// Computes the sums of each point in moved_.
  void look_alone() {
#if HWY_MAX_BYTES == 64
    if (shared_ && moved_count_ > 0 && ByteWindows::supported()) {
      if (!byte_windows_)
        byte_windows_.emplace(patch_.slope_x(), patch_.slope_y(), patch_.rows() + window - 1);
      byte_windows_->sum(moved(), pixel_, to_, at_, there_);
      return;
    }
#endif
    for (const auto i : moved()) look(i);
  }

  /// Computes the sums of gradient * there with the window at each of the four pixels around its
  /// position in the other image.
  void look(int i) {
    const Values values;
    const int lanes = static_cast<int>(hn::Lanes(values));
    const auto stride = to_.stride();
    BothSum upper_left;
    BothSum upper_right;
    BothSum lower_left;
    BothSum lower_right;
    for (int column = 0; column < row_values; column += lanes) {
      const auto weight = weights(column);
      const auto* slope_x = patch_.slope_x() + window_[i] + column;
      const auto* slope_y = patch_.slope_y() + window_[i] + column;
      const auto* pixels = to_.row(0) + at_[i] + column;
      auto left = load_pixels(pixels);
      auto right = load_pixels(pixels + 1);
      for_each_row([&](int row) {
        const int at = row * Patch::stride;
        const auto slopes = load_slopes(slope_x + at, slope_y + at, weight);
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

  /// Stores the pixels that points are in, queues points that entered another pixel in moved_, and
  /// deactivates points that left the image.
  template <class Mask>
  void locate(int i, Mask active, hn::Vec<Floats> flow_x, hn::Vec<Floats> flow_y) {
    const Floats floats;
    const auto cell_x = hn::Floor(hn::Add(flow_x, hn::Set(floats, right_)));
    const auto cell_y = hn::Floor(hn::Add(flow_y, hn::Set(floats, down_)));
    const auto x = hn::Add(cell_x, hn::Load(floats, left_ + i));
    const auto y = hn::Add(cell_y, hn::Load(floats, top_ + i));
    const auto least = hn::Set(floats, -static_cast<float>(window));
    const auto inside = hn::And(
        hn::And(hn::Ge(x, least), hn::Lt(x, hn::Set(floats, static_cast<float>(to_.width())))),
        hn::And(hn::Ge(y, least), hn::Lt(y, hn::Set(floats, static_cast<float>(to_.height())))));
    active = hn::And(active, inside);
    const Ints ints;
    const auto stride = hn::Set(ints, static_cast<std::int32_t>(to_.stride()));
    const auto row = hn::ConvertTo(ints, hn::IfThenElseZero(inside, y));
    const auto column = hn::ConvertTo(ints, hn::IfThenElseZero(inside, x));
    hn::Store(hn::Add(hn::Mul(row, stride), column), ints, at_ + i);
    if (shared_) hn::Store(shared_->index(cell_x, cell_y), ints, displacement_ + i);
    const auto moved = hn::And(active, hn::Or(hn::Ne(cell_x, hn::Load(floats, cell_x_ + i)),
                                              hn::Ne(cell_y, hn::Load(floats, cell_y_ + i))));
    hn::Store(cell_x, floats, cell_x_ + i);
    hn::Store(cell_y, floats, cell_y_ + i);
    hn::Store(hn::IfThenElseZero(active, hn::Set(floats, 1.0F)), floats, active_ + i);
    // A whole vector fits, because at most i are queued.
    hn::StoreU(hn::Compress(hn::Iota(ints, i), hn::RebindMask(ints, moved)), ints,
               moved_ + moved_count_);
    moved_count_ += static_cast<int>(hn::CountTrue(floats, moved));
  }

  /// Moves a vector of points by one Gauss-Newton step.
  template <class Mask>
  void move(int i, Mask active, bool has_before) {
    const Floats floats;
    const Ints ints;
    const auto flow_x = hn::Load(floats, flow_x_ + i);
    const auto flow_y = hn::Load(floats, flow_y_ + i);
    const auto beyond_x =
        hn::Sub(hn::Add(flow_x, hn::Set(floats, right_)), hn::Load(floats, cell_x_ + i));
    const auto beyond_y =
        hn::Sub(hn::Add(flow_y, hn::Set(floats, down_)), hn::Load(floats, cell_y_ + i));
    // Sums of gradient * (there - here).
    hn::Vec<Floats> mismatch_x[corners];
    hn::Vec<Floats> mismatch_y[corners];
    for (int c = 0; c < corners; ++c) {
      hn::Vec<Ints> there_x;
      hn::Vec<Ints> there_y;
      hn::LoadInterleaved2(ints, &there_[c][i].x, there_x, there_y);
      const auto subtract = [&](auto there, const std::int32_t* here) {
        return hn::ConvertTo(floats, hn::Sub(hn::ShiftLeft<2>(there), hn::Load(ints, here + i)));
      };
      mismatch_x[c] = subtract(there_x, here_x_);
      mismatch_y[c] = subtract(there_y, here_y_);
    }
    const auto bilinear = [&](const auto& corners) {
      const auto between = [](auto a, auto b, auto part) {
        return hn::Add(a, hn::Mul(hn::Sub(b, a), part));
      };
      return hn::Mul(between(between(corners[0], corners[1], beyond_x),
                             between(corners[2], corners[3], beyond_x), beyond_y),
                     hn::Set(floats, mismatch_product));
    };
    const auto x = bilinear(mismatch_x);
    const auto y = bilinear(mismatch_y);
    const auto xx = hn::Load(floats, xx_ + i);
    const auto xy = hn::Load(floats, xy_ + i);
    const auto yy = hn::Load(floats, yy_ + i);
    const auto inverse = hn::Load(floats, inverse_ + i);
    const auto move_x = hn::Mul(hn::Sub(hn::Mul(xy, y), hn::Mul(yy, x)), inverse);
    const auto move_y = hn::Mul(hn::Sub(hn::Mul(xy, x), hn::Mul(xx, y)), inverse);
    auto to_x = hn::Add(flow_x, move_x);
    auto to_y = hn::Add(flow_y, move_y);
    auto stops = hn::Le(hn::Add(hn::Mul(move_x, move_x), hn::Mul(move_y, move_y)),
                        hn::Set(floats, min_move * min_move));
    if (has_before) {
      const auto limit = hn::Set(floats, turning_back);
      const auto turns = hn::AndNot(
          stops, hn::And(hn::Lt(hn::Abs(hn::Add(move_x, hn::Load(floats, before_x_ + i))), limit),
                         hn::Lt(hn::Abs(hn::Add(move_y, hn::Load(floats, before_y_ + i))), limit)));
      const auto half = hn::Set(floats, 0.5F);
      to_x = hn::IfThenElse(turns, hn::Sub(to_x, hn::Mul(move_x, half)), to_x);
      to_y = hn::IfThenElse(turns, hn::Sub(to_y, hn::Mul(move_y, half)), to_y);
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
  const Patch& patch_;
  std::optional<SharedSums> shared_;  ///< if there are many points
#if HWY_MAX_BYTES == 64
  std::optional<ByteWindows> byte_windows_;  ///< made once many points are summed one by one
#endif
  int count_;
  float right_;
  float down_;
  int moved_count_ = 0;
  int window_[capacity];  ///< index of its first value in the patch
  int pixel_[capacity];   ///< its index among the pixels of the patch
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
  const auto [first, last] = std::minmax_element(
      searches.begin(), searches.end(), [](const auto& a, const auto& b) { return a.y < b.y; });
  const Patch patch(from, gradients, tile, first->y, last->y);
  Points points(to, tile, searches, patch);
  points.search();
  points.store(searches);
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
