// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/patches.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/dis/patches.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/flow/product_sum-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Pixels of a patch: up to two rows of 8x8 pixels, or all four of 4x4.
using Words = hn::CappedTag<std::int16_t, 16>;
using Word = hn::Vec<Words>;

/// Lanes of a sum after its halves are added.
using Quarters = hn::CappedTag<std::int32_t, 4>;

/// One lane per patch or pixel.
using Floats = hn::CappedTag<float, row_padding>;
using Vector = hn::Vec<Floats>;

/// Lower bound to which determinants of gradient matrices are clamped.
constexpr double min_determinant = 1e-3;

using WordSum = ProductSum<Words>;

template <class Sum>
HWY_INLINE hn::Vec<Quarters> quarters(Sum sum) {
#if HWY_TARGET != HWY_SCALAR
  if constexpr (hn::MaxLanes(hn::DFromV<Sum>()) > hn::MaxLanes(Quarters()))
    return hn::LowerHalf(Quarters(), sum) + hn::UpperHalf(Quarters(), sum);
  else
#endif
    return sum;
}

/// Sums over the differences of a patch from the other image, with the patch at one corner of its
/// cell of four pixels.
struct Corner {
  // Not defaulted: see ProductSum.
  Corner() {}  // NOLINT(modernize-use-equals-default)
  HWY_INLINE void add(Word d) {
    square.add(d, d);
    plain.add(d, hn::Set(Words(), 1));
  }
  HWY_INLINE void add_slopes(Word d, Word slope_x, Word slope_y) {
    along_x.add(d, slope_x);
    along_y.add(d, slope_y);
  }

  WordSum square;
  WordSum plain;
  WordSum along_x;
  WordSum along_y;
};

/// Quantities to compute from the sums of a cell.
enum class Sums { error, error_and_step };

/// Adds up the lanes of four sums.
HWY_INLINE void store_totals(const WordSum& sum0, const WordSum& sum1, const WordSum& sum2,
                             const WordSum& sum3, std::int32_t* out) {
#if HWY_TARGET == HWY_SCALAR
  for (const auto* sum : {&sum0, &sum1, &sum2, &sum3}) *out++ = hn::GetLane(sum->lanes());
#else
  const Quarters lanes;
  hn::StoreU(add_lanes(lanes, quarters(sum0.lanes()), quarters(sum1.lanes()),
                       quarters(sum2.lanes()), quarters(sum3.lanes())),
             lanes, out);
#endif
}

/// Searches for up to `capacity` patches of a row, one lane per patch.
///
/// In a cell of four pixels of the other image, the differences of a patch are the bilinear mean of
/// its differences at the four corners, and their sums are polynomials of the four weights. So
/// pixels are read only when a patch enters another cell.
template <int side>
class Search {
 public:
  static constexpr int capacity = 64;

  Search(const PatchGrid& grid, const Image<std::uint8_t>& from, const Gradients& gradients,
         const Image<std::uint8_t>& to, int row, int first, int count, const Flow* flows)
      : from_(from),
        gradients_(gradients),
        to_(to),
        top_(row * grid.stride),
        left_(first * grid.stride),
        stride_(grid.stride),
        count_(count) {
    for (int i = 0; i < count; ++i) {
      left_of_[i] = static_cast<float>(left_ + i * stride_);
      start_x_[i] = flow_x_[i] = flows[i].x;
      start_y_[i] = flow_y_[i] = flows[i].y;
      previous_[i] = std::numeric_limits<float>::infinity();
      leave_cell(i);
      active_[i] = 1;
    }
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int i = count; i < (count + lanes - 1) / lanes * lanes; ++i) {
      active_[i] = left_of_[i] = flow_x_[i] = flow_y_[i] = cell_x_[i] = cell_y_[i] = 0;
    }
  }

  /// Starts patches from the best flow of their neighbours; deactivates patches whose own flow is
  /// about as good.
  void start_from(const Image<Flow>& found, int row) {
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    move_to(flow_x_, flow_y_);
    read_moved<Sums::error>();
    for (int i = 0; i < count_; i += lanes)
      hn::Store(hn::Set(floats, better_share) * Cell(*this, i).error() - hn::Set(floats, better_by),
                floats, previous_ + i);
    const int first = left_ / stride_;
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, found.height() - 1); ++y) {
      for (int offset = -1; offset <= 1; ++offset) {
        if (y == row && offset == 0) continue;
        HWY_ALIGN float flow_x[capacity] = {};
        HWY_ALIGN float flow_y[capacity] = {};
        for (int i = 0; i < count_; ++i) {
          const Flow& flow = found.at(std::clamp(first + i + offset, 0, found.width() - 1), y);
          flow_x[i] = flow.x;
          flow_y[i] = flow.y;
        }
        move_to(flow_x, flow_y);
        read_moved<Sums::error>();
        for (int i = 0; i < count_; i += lanes) {
          const auto error = Cell(*this, i).error();
          const auto is_better = error < hn::Load(floats, previous_ + i);
          hn::BlendedStore(error, is_better, floats, previous_ + i);
          hn::BlendedStore(hn::Load(floats, flow_x + i), is_better, floats, flow_x_ + i);
          hn::BlendedStore(hn::Load(floats, flow_y + i), is_better, floats, flow_y_ + i);
        }
      }
    }
    for (int i = 0; i < count_; ++i) {
      active_[i] = flow_x_[i] == start_x_[i] && flow_y_[i] == start_y_[i] ? 0 : 1;
      start_x_[i] = flow_x_[i];
      start_y_[i] = flow_y_[i];
      previous_[i] = std::numeric_limits<float>::infinity();
      leave_cell(i);
    }
  }

  void run(int iterations) {
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; ++i)
      if (active_[i] != 0) read_gradients(i);
    move_to(flow_x_, flow_y_);
    for (int iteration = 0; iteration < iterations; ++iteration) {
      read_moved<Sums::error_and_step>();
      bool any = false;
      for (int i = 0; i < count_; i += lanes) {
        const auto active = hn::Load(floats, active_ + i) != hn::Zero(floats);
        if (hn::AllFalse(floats, active)) continue;
        any = true;
        descend(i, active);
      }
      if (!any) break;
    }
  }

  void store(Flow* flows) const {
    for (int i = 0; i < count_; ++i) {
      const float x = flow_x_[i] - start_x_[i];
      const float y = flow_y_[i] - start_y_[i];
      flows[i] = x * x + y * y <= float{side * side} ? Flow{flow_x_[i], flow_y_[i]}
                                                     : Flow{start_x_[i], start_y_[i]};
    }
  }

 private:
  static constexpr float pixels = side * side;

  static constexpr int vector_size = hn::MaxLanes(Words());

  /// Pixels of the patch at (x, y), row by row, starting at number `first`.
  template <class Tag, class T>
  static HWY_INLINE hn::Vec<Tag> load_pixels(Tag tag, const Image<T>& plane, int x, int y,
                                             int first) {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (hn::MaxLanes(tag) > side) {
      const hn::Half<Tag> half;
      constexpr int half_size = hn::MaxLanes(half);
      return hn::Combine(tag, load_pixels(half, plane, x, y, first + half_size),
                         load_pixels(half, plane, x, y, first));
    } else
#endif
      return hn::LoadU(tag, plane.row(y + first / side) + x + first % side);
  }
  static HWY_INLINE Word load_words(const Image<std::uint8_t>& plane, int x, int y, int first) {
    const hn::Rebind<std::uint8_t, Words> bytes;
    return hn::PromoteTo(Words(), load_pixels(bytes, plane, x, y, first));
  }
  static HWY_INLINE Word load_words(const Image<std::int16_t>& plane, int x, int y, int first) {
    return load_pixels(Words(), plane, x, y, first);
  }

  /// Computes the values that stay constant during the search for a patch.
  void read_gradients(int i) {
    const int x = left_ + i * stride_;
    WordSum xx;
    WordSum xy;
    WordSum yy;
    WordSum total_x;
    WordSum total_y;
    const auto one = hn::Set(Words(), 1);
    for (int first = 0; first < side * side; first += vector_size) {
      const auto slope_x = load_words(gradients_.x(), x, top_, first);
      const auto slope_y = load_words(gradients_.y(), x, top_, first);
      xx.add(slope_x, slope_x);
      xy.add(slope_x, slope_y);
      yy.add(slope_y, slope_y);
      total_x.add(slope_x, one);
      total_y.add(slope_y, one);
    }
    std::int32_t totals[8];
    store_totals(xx, xy, yy, yy, totals);
    store_totals(total_x, total_y, total_x, total_y, totals + 4);
    const double determinant =
        std::max(min_determinant, static_cast<double>(std::int64_t{totals[0]} * totals[2] -
                                                      std::int64_t{totals[1]} * totals[1]));
    inverse_xx_[i] = static_cast<float>(totals[2] / determinant);
    inverse_xy_[i] = static_cast<float>(-totals[1] / determinant);
    inverse_yy_[i] = static_cast<float>(totals[0] / determinant);
    mean_x_[i] = static_cast<float>(totals[4]) / pixels;
    mean_y_[i] = static_cast<float>(totals[5]) / pixels;
  }

  /// Makes locate() queue a patch at its next position.
  void leave_cell(int i) {
    cell_x_[i] = cell_y_[i] = std::numeric_limits<float>::max();
  }

  /// Computes the sums of the differences d0 ... d3 at the four corners of a patch's cell, and of
  /// their products.
  template <Sums sums>
  void read_cell(int i) {
    const int x = left_ + i * stride_;
    const int to_x = static_cast<int>(cell_x_[i]);
    const int to_y = static_cast<int>(cell_y_[i]);
    Corner c0;
    Corner c1;
    Corner c2;
    Corner c3;
    WordSum d01;
    WordSum d02;
    WordSum d03;
    WordSum d12;
    WordSum d13;
    WordSum d23;
    for (int first = 0; first < side * side; first += vector_size) {
      const auto here = load_words(from_, x, top_, first);
      const auto d0 = load_words(to_, to_x, to_y, first) - here;
      const auto d1 = load_words(to_, to_x + 1, to_y, first) - here;
      const auto d2 = load_words(to_, to_x, to_y + 1, first) - here;
      const auto d3 = load_words(to_, to_x + 1, to_y + 1, first) - here;
      c0.add(d0);
      c1.add(d1);
      c2.add(d2);
      c3.add(d3);
      d01.add(d0, d1);
      d02.add(d0, d2);
      d03.add(d0, d3);
      d12.add(d1, d2);
      d13.add(d1, d3);
      d23.add(d2, d3);
      if constexpr (sums == Sums::error_and_step) {
        const auto slope_x = load_words(gradients_.x(), x, top_, first);
        const auto slope_y = load_words(gradients_.y(), x, top_, first);
        c0.add_slopes(d0, slope_x, slope_y);
        c1.add_slopes(d1, slope_x, slope_y);
        c2.add_slopes(d2, slope_x, slope_y);
        c3.add_slopes(d3, slope_x, slope_y);
      }
    }
    std::int32_t totals[max_sums];
    store_totals(c0.square, c1.square, c2.square, c3.square, totals);
    store_totals(d01, d02, d03, d12, totals + 4);
    store_totals(d13, d23, d13, d23, totals + 8);
    store_totals(c0.plain, c1.plain, c2.plain, c3.plain, totals + sum);
    if constexpr (sums == Sums::error_and_step) {
      store_totals(c0.along_x, c1.along_x, c2.along_x, c3.along_x, totals + sum_x);
      store_totals(c0.along_y, c1.along_y, c2.along_y, c3.along_y, totals + sum_y);
    }
    for (int k = 0; k < (sums == Sums::error ? sum_x : max_sums); ++k)
      sums_[k][i] = static_cast<float>(totals[k]);
  }

  /// Stores the positions of patches, and queues those that entered another cell.
  template <class Mask>
  void locate(int i, Mask active, Vector flow_x, Vector flow_y) {
    const Floats floats;
    const auto clamped = [&](Vector place, int size) {
      return hn::Min(hn::Max(place, hn::Set(floats, float{1 - side})),
                     hn::Set(floats, static_cast<float>(size - 1)));
    };
    const auto x = clamped(hn::Load(floats, left_of_ + i) + flow_x, to_.width());
    const auto y = clamped(hn::Set(floats, static_cast<float>(top_)) + flow_y, to_.height());
    const auto cell_x = hn::Floor(x);
    const auto cell_y = hn::Floor(y);
    const auto moved = hn::And(active, hn::Or(cell_x != hn::Load(floats, cell_x_ + i),
                                              cell_y != hn::Load(floats, cell_y_ + i)));
    hn::Store(cell_x, floats, cell_x_ + i);
    hn::Store(cell_y, floats, cell_y_ + i);
    hn::Store(x - cell_x, floats, right_ + i);
    hn::Store(y - cell_y, floats, down_ + i);
    hn::Store(hn::IfThenElseZero(active, hn::Set(floats, 1.0F)), floats, active_ + i);
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(floats, moved, bytes);
    for (unsigned bits = bytes[0] | bytes[1] << 8U; bits != 0; bits &= bits - 1)
      moved_[moved_count_++] = static_cast<std::int16_t>(i + std::countr_zero(bits));
  }

  void move_to(const float* flow_x, const float* flow_y) {
    const Floats floats;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    for (int i = 0; i < count_; i += lanes)
      locate(i, hn::Load(floats, active_ + i) != hn::Zero(floats), hn::Load(floats, flow_x + i),
             hn::Load(floats, flow_y + i));
  }

  template <Sums sums>
  void read_moved() {
    for (int k = 0; k < moved_count_; ++k) read_cell<sums>(moved_[k]);
    moved_count_ = 0;
  }

  /// Bilinear weights of a vector of patches in their cells.
  class Cell {
   public:
    HWY_INLINE Cell(const Search& search, int i) : search_(search), i_(i) {
      const auto one = hn::Set(Floats(), 1.0F);
      const auto right = load(search.right_);
      const auto down = load(search.down_);
      const auto left = one - right;
      const auto up = one - down;
      w0_ = up * left;
      w1_ = up * right;
      w2_ = down * left;
      w3_ = down * right;
      all_ = weighted(sum);
    }

    /// The sum of the differences times a gradient, less its mean.
    HWY_INLINE Vector along(int k, const float* mean) const {
      return weighted(k) - all_ * load(mean);
    }

    /// The sum of the squared deviations of the differences from their mean.
    HWY_INLINE Vector error() const {
      const auto cross0 = w1_ * total(4) + w2_ * total(5) + w3_ * total(6);
      const auto cross1 = w2_ * total(7) + w3_ * total(8);
      const auto cross2 = w3_ * total(9);
      const auto part = [&](Vector weight, int square, Vector cross) {
        return weight * (weight * total(square) + hn::Set(Floats(), 2.0F) * cross);
      };
      const auto squares = part(w0_, 0, cross0) + part(w1_, 1, cross1) +
                           (part(w2_, 2, cross2) + w3_ * (w3_ * total(3)));
      return squares - all_ * (all_ * hn::Set(Floats(), 1 / pixels));
    }

   private:
    HWY_INLINE Vector load(const float* values) const { return hn::Load(Floats(), values + i_); }
    HWY_INLINE Vector total(int k) const { return load(search_.sums_[k]); }
    HWY_INLINE Vector weighted(int k) const {
      return w0_ * total(k) + w1_ * total(k + 1) + (w2_ * total(k + 2) + w3_ * total(k + 3));
    }

    const Search& search_;
    int i_;
    Vector w0_;
    Vector w1_;
    Vector w2_;
    Vector w3_;
    Vector all_;
  };

  /// Moves a vector of patches by a step, and stops those whose error has not decreased.
  template <class Mask>
  void descend(int i, Mask active) {
    const Floats floats;
    const auto load = [&](const float* values) { return hn::Load(floats, values + i); };
    const Cell cell(*this, i);
    const auto along_x = cell.along(sum_x, mean_x_);
    const auto along_y = cell.along(sum_y, mean_y_);
    const auto error = cell.error();
    const auto xx = load(inverse_xx_);
    const auto xy = load(inverse_xy_);
    const auto yy = load(inverse_yy_);
    const auto step_x = xx * along_x + xy * along_y;
    const auto step_y = xy * along_x + yy * along_y;
    const auto old_x = load(flow_x_);
    const auto old_y = load(flow_y_);
    const auto flow_x = hn::IfThenElse(active, old_x - step_x, old_x);
    const auto flow_y = hn::IfThenElse(active, old_y - step_y, old_y);
    hn::Store(flow_x, floats, flow_x_ + i);
    hn::Store(flow_y, floats, flow_y_ + i);
    const auto goes_on = hn::And(active, error < load(previous_));
    hn::Store(error, floats, previous_ + i);
    locate(i, goes_on, flow_x, flow_y);
  }

  // Indices of sums: 0 to 3 are the squares of d0 ... d3; 4 to 9 the products d0 d1, d0 d2, d0 d3,
  // d1 d2, d1 d3 and d2 d3; then follow d0 ... d3, alone and times each gradient.
  static constexpr int sum = 12;
  static constexpr int sum_x = 16;
  static constexpr int sum_y = 20;
  static constexpr int max_sums = 24;

  const Image<std::uint8_t>& from_;
  const Gradients& gradients_;
  const Image<std::uint8_t>& to_;
  int top_;
  int left_;
  int stride_;
  int count_;
  int moved_count_ = 0;
  std::int16_t moved_[capacity];
  HWY_ALIGN float left_of_[capacity];
  HWY_ALIGN float start_x_[capacity];
  HWY_ALIGN float start_y_[capacity];
  HWY_ALIGN float flow_x_[capacity];
  HWY_ALIGN float flow_y_[capacity];
  HWY_ALIGN float cell_x_[capacity];
  HWY_ALIGN float cell_y_[capacity];
  HWY_ALIGN float right_[capacity];
  HWY_ALIGN float down_[capacity];
  HWY_ALIGN float active_[capacity];
  HWY_ALIGN float previous_[capacity];
  HWY_ALIGN float inverse_xx_[capacity];
  HWY_ALIGN float inverse_xy_[capacity];
  HWY_ALIGN float inverse_yy_[capacity];
  HWY_ALIGN float mean_x_[capacity];
  HWY_ALIGN float mean_y_[capacity];
  HWY_ALIGN float sums_[max_sums][capacity];
};

template <int side>
void search(const PatchGrid& grid, const Image<std::uint8_t>& from, const Gradients& gradients,
            const Image<std::uint8_t>& to, int row, int iterations, const Image<Flow>* found,
            Flow* flows) {
  const Flow* starts = found != nullptr ? found->row(row) : flows;
  for (int first = 0; first < grid.columns; first += Search<side>::capacity) {
    const int count = std::min(grid.columns - first, Search<side>::capacity);
    Search<side> patches(grid, from, gradients, to, row, first, count, starts + first);
    if (found != nullptr) patches.start_from(*found, row);
    patches.run(iterations);
    patches.store(flows + first);
  }
}

void search_one_row(const PatchGrid& grid, const Image<std::uint8_t>& from,
                    const Gradients& gradients, const Image<std::uint8_t>& to, int row,
                    int iterations, const Image<Flow>* found, Flow* flows) {
  if (grid.side == 4)
    search<4>(grid, from, gradients, to, row, iterations, found, flows);
  else
    search<8>(grid, from, gradients, to, row, iterations, found, flows);
}

using Field = VariationalRefinement::Field;

/// Weighted sums over the patches that cover the pixels of a row.
struct SumRow {
  float* x;
  float* y;
  float* weight;
};

/// Adds rows [first, last) of a patch at (x, y) with this flow. sums_of(row) returns the sums of a
/// row.
template <int side, class SumsOf>
HWY_INLINE void add_patch(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, int x,
                          int y, int width, int first, int last, const Flow& flow,
                          const SumsOf& sums_of) {
  const hn::CappedTag<float, side> floats;
  const hn::RebindToSigned<decltype(floats)> ints;
  const hn::Rebind<std::uint8_t, decltype(floats)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  // Past these limits, all pixels would be replicated ones.
  const float to_x = std::clamp(static_cast<float>(x) + flow.x, static_cast<float>(-width),
                                static_cast<float>(to.width()));
  const float to_y = std::clamp(static_cast<float>(y) + flow.y, static_cast<float>(y - last),
                                static_cast<float>(to.height()));
  const int left = static_cast<int>(std::floor(to_x));
  const int top = static_cast<int>(std::floor(to_y));
  const auto right = hn::Set(floats, to_x - static_cast<float>(left));
  const auto down = hn::Set(floats, to_y - static_cast<float>(top));
  const auto flow_x = hn::Set(floats, flow.x);
  const auto flow_y = hn::Set(floats, flow.y);
  const auto one = hn::Set(floats, 1.0F);
  const auto load = [&](const std::uint8_t* pixels) {
    return hn::ConvertTo(floats, hn::PromoteTo(ints, hn::LoadU(bytes, pixels)));
  };
  for (int k = 0; k < width; k += lanes) {
    const auto along = [&](int row) {
      const std::uint8_t* pixels = to.row(row - y + top) + left + k;
      return lerp(load(pixels), load(pixels + 1), right);
    };
    auto above = along(first);
    for (int row = first; row < last; ++row) {
      const auto below = along(row + 1);
      const auto there = lerp(above, below, down);
      above = below;
      const auto difference = hn::Abs(there - load(from.row(row) + x + k));
      const auto weight = one / hn::Max(one, difference);
      const SumRow sums = sums_of(row);
      const auto add = [&](float* sum, auto value) {
        hn::StoreU(hn::LoadU(floats, sum + x + k) + value, floats, sum + x + k);
      };
      add(sums.x, weight * flow_x);
      add(sums.y, weight * flow_y);
      add(sums.weight, weight);
    }
  }
}

void divide_row(const SumRow& sums, int y, Field& out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int k = 0; k < out.x.count(0); k += lanes) {
    const auto load = [&](const float* row, Vector* values) {
      hn::LoadInterleaved2(floats, row + std::ptrdiff_t{2} * k, values[0], values[1]);
    };
    Vector x[2];
    Vector y_[2];
    Vector weight[2];
    load(sums.x, x);
    load(sums.y, y_);
    load(sums.weight, weight);
    for (int parity = 0; parity < 2; ++parity) {
      hn::StoreU(x[parity] / weight[parity], floats, out.x.row(parity, y) + k);
      hn::StoreU(y_[parity] / weight[parity], floats, out.y.row(parity, y) + k);
    }
  }
  out.x.replicate_ends(y);
  out.y.replicate_ends(y);
}

template <int side>
void spread(const PatchGrid& grid, const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
            const Image<Flow>& flows, int first, int last, std::vector<float>& scratch,
            Field& out) {
  const int padded_width = from.width() + 3 * row_padding;
  float* sums = scratch_of(scratch, std::size_t{3} * static_cast<std::size_t>(padded_width) *
                                        static_cast<std::size_t>(last - first));
  const auto sums_of = [&](int row) -> SumRow {
    float* values = sums + std::ptrdiff_t{row - first} * 3 * padded_width;
    return {values, values + padded_width, values + std::ptrdiff_t{2} * padded_width};
  };
  const int width = from.width();
  for (int row = first; row < last; ++row) {
    const SumRow sum = sums_of(row);
    std::fill_n(sum.x, 2 * padded_width + width, 0.0F);
    std::fill(sum.weight + width, sum.weight + padded_width, 1.0F);
  }
  const int first_patches = std::clamp((first - side) / grid.stride, 0, grid.rows - 1);
  for (int j = first_patches; j < grid.rows && j * grid.stride < last; ++j) {
    const int top = std::max(first, j * grid.stride);
    const int bottom = std::min(last, j == grid.rows - 1 ? last : j * grid.stride + side);
    for (int i = 0; i < grid.columns; ++i) {
      const int left = i * grid.stride;
      const int covered = i == grid.columns - 1 ? width - left : side;
      add_patch<side>(from, to, left, j * grid.stride, covered, top, bottom, flows.at(i, j),
                      sums_of);
    }
  }
  for (int row = first; row < last; ++row) divide_row(sums_of(row), row, out);
}

void spread_rows(const PatchGrid& grid, const Image<std::uint8_t>& from,
                 const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                 std::vector<float>& sums, Field& out) {
  if (grid.side == 4)
    spread<4>(grid, from, to, flows, first, last, sums, out);
  else
    spread<8>(grid, from, to, flows, first, last, sums, out);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(search_one_row);
HWY_EXPORT(spread_rows);

void search_row(const PatchGrid& grid, const Image<std::uint8_t>& from, const Gradients& gradients,
                const Image<std::uint8_t>& to, int row, int iterations, const Image<Flow>* found,
                Flow* flows) {
  HWY_DYNAMIC_DISPATCH(search_one_row)(grid, from, gradients, to, row, iterations, found, flows);
}

void spread_patches(const PatchGrid& grid, const Image<std::uint8_t>& from,
                    const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                    std::vector<float>& sums, VariationalRefinement::Field& out) {
  HWY_DYNAMIC_DISPATCH(spread_rows)(grid, from, to, flows, first, last, sums, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
