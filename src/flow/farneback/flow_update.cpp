// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/flow_update.hpp"

#include <hwy/cache_control.h>

#include <algorithm>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/farneback/flow_update.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Vector = hn::Vec<Floats>;
using WordVector = hn::Vec<Words>;
constexpr int coefficients = PolynomialExpansion::coefficients;
constexpr std::ptrdiff_t group = PolynomialExpansion::group;
constexpr int reach = FlowUpdate::reach;
constexpr int window_rows = FlowUpdate::window_rows;
constexpr int strip = FlowUpdate::strip;
/// Coefficients of the normal equations: symmetric 2x2 matrix and right-hand side.
constexpr int equations = FlowUpdate::equations;

/// Interpolates the polynomials of a row between columns.
struct Columns {
  Lookup<Floats> first;
  Lookup<Floats> second;
  Vector left;  ///< weight of the first
  Vector right;

  HWY_INLINE Vector of(const float* low_lanes, const float* high_lanes) const {
    const Floats floats;
    const auto low = hn::Load(floats, low_lanes);
    const auto high = hn::Load(floats, high_lanes);
    return left * first(low, high) + right * second(low, high);
  }
};

/// Adds the weighted polynomials of `rows` rows.
template <int rows>
HWY_INLINE void add_weighted(const PolynomialExpansion& to, int column, int row,
                             const Columns& columns, const Vector* weights, Vector* sums) {
  constexpr int lanes = static_cast<int>(hn::MaxLanes(Floats()));
  for (int i = 0; i < rows; ++i) {
    const float* low = to.at(column, row + i);
    const float* high = to.at(column + lanes, row + i);
    for (int k = 0; k < coefficients; ++k)
      sums[k] = sums[k] + weights[i] * columns.of(low + k * group, high + k * group);
  }
}

/// Positions in the later image to which the flow moves a vector of pixels.
struct Targets {
  hn::Mask<Words> inside;  ///< true within the image
  WordVector column;       ///< of the pixel to the upper left of the target
  WordVector row;
  Vector right;  ///< sub-pixel offset from that pixel
  Vector down;

  HWY_INLINE Targets(const PolynomialExpansion& to, Vector dx, Vector dy, int x, int y) {
    const Floats floats;
    const auto zero = hn::Zero(floats);
    const auto to_x = iota(floats, static_cast<float>(x)) + dx;
    const auto to_y = hn::Set(floats, static_cast<float>(y)) + dy;
    const auto right_end = hn::Set(floats, static_cast<float>(to.width() - 1));
    const auto lower_end = hn::Set(floats, static_cast<float>(to.height() - 1));
    const auto is_inside =
        hn::And(hn::And(to_x >= zero, to_x <= right_end), hn::And(to_y >= zero, to_y <= lower_end));
    const auto in_x = hn::IfThenElseZero(is_inside, to_x);
    const auto in_y = hn::IfThenElseZero(is_inside, to_y);
    inside = hn::RebindMask(Words(), is_inside);
    column = hn::ConvertTo(Words(), in_x);
    row = hn::ConvertTo(Words(), in_y);
    right = in_x - hn::ConvertTo(floats, column);
    down = in_y - hn::ConvertTo(floats, row);
  }
};

/// Interpolates the later polynomials bilinearly; outside the image they are 0.
///
/// Neighbours mostly have similar flow: their targets lie between columns of the same two vectors,
/// in the same row or an adjacent one. All such lanes read the same three rows; the row that a lane
/// does not need has weight 0. The remaining lanes are then grouped in the same way.
HWY_INLINE void interpolate(const PolynomialExpansion& to, const Targets& targets, Vector* sums) {
  const Words words;
  const Floats floats;
  constexpr int lanes = static_cast<int>(hn::MaxLanes(words));
  const auto left = hn::Set(floats, 1.0F) - targets.right;
  const auto up = hn::Set(floats, 1.0F) - targets.down;
  HWY_ALIGN std::int32_t columns[lanes];
  HWY_ALIGN std::int32_t rows[lanes];
  hn::Store(targets.column, words, columns);
  hn::Store(targets.row, words, rows);
  for (int k = 0; k < coefficients; ++k) sums[k] = hn::Zero(floats);
  auto remaining = targets.inside;
  for (;;) {
    const auto lane = hn::FindFirstTrue(words, remaining);
    if (lane < 0) return;
    const int column = columns[lane] & -lanes;
    const auto before = targets.row == hn::Set(words, rows[lane] - 1);
    const int row = rows[lane] - (hn::AllFalse(words, hn::And(before, remaining)) ? 0 : 1);
    const auto index = targets.column - hn::Set(words, column);
    const auto in_columns =
        hn::And(index > hn::Set(words, -1), index < hn::Set(words, 2 * lanes - 1));
    const auto in_reach = hn::And(in_columns, remaining);
    const auto in_upper = hn::And(targets.row == hn::Set(words, row), in_reach);
    const auto in_lower = hn::And(targets.row == hn::Set(words, row + 1), in_reach);
    remaining = hn::AndNot(hn::Or(in_upper, in_lower), remaining);
    const auto upper = hn::RebindMask(floats, in_upper);
    const auto lower = hn::RebindMask(floats, in_lower);
    const Vector weights[] = {
        hn::IfThenElseZero(upper, up),
        hn::IfThenElse(upper, targets.down, hn::IfThenElseZero(lower, up)),
        hn::IfThenElseZero(lower, targets.down),
    };
    const Lookup<Floats> first(index);
    const Lookup<Floats> second(index + hn::Set(words, 1));
    const Columns between{first, second, left, targets.right};
    const float* next = to.at(std::min(column + strip, to.width()), row + 1);
    for (int k = 0; k < coefficients; ++k) hwy::Prefetch(next + k * group);
    if (hn::AllFalse(floats, lower))
      add_weighted<2>(to, column, row, between, weights, sums);
    else
      add_weighted<3>(to, column, row, between, weights, sums);
  }
}

using RowSums = FlowUpdate::RowSums;

/// Replaces the equations of each row of a block by their sum over this row and all later ones.
void complete_block(RowSums& sums) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int equation = 0; equation < equations; ++equation) {
    for (int x = 0; x < strip; x += lanes) {
      auto sum = hn::Load(floats, sums.rows[window_rows - 1][equation] + x);
      for (int row = window_rows - 2; row >= 0; --row) {
        float* at = sums.rows[row][equation] + x;
        sum = sum + hn::Load(floats, at);
        hn::Store(sum, floats, at);
      }
    }
  }
}

/// Rows of floats, one per equation.
template <int width>
using EquationRows = float[equations][width + 2 * row_padding];

/// Sums over the rows of a window for a strip, after the last sums of the strip to the left.
struct Window {
  static constexpr int before = row_padding;
  HWY_ALIGN EquationRows<before + strip> sums = {};
};

/// Adds the equations of columns [left, right) of image row y, which is row `row` of the current
/// block, and computes the sums over the rows of the window that ends there.
void add_row(const PolynomialExpansion& from, const PolynomialExpansion& to, const Flow* flow,
             int y, int left, int right, float row_weight, const float* column_weights, int row,
             RowSums& sums, Window& window) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto half = hn::Set(floats, 0.5F);
  const auto one = hn::Set(floats, 1.0F);
  for (int x = left; x < right; x += lanes) {
    Vector dx;
    Vector dy;
    hn::LoadInterleaved2(floats, &flow[x].x, dx, dy);
    const Targets targets(to, dx, dy, x, y);
    Vector there[coefficients];
    interpolate(to, targets, there);
    const float* polynomials = from.at(x, y);
    const float* next = from.at(std::min(x + strip, from.width()), y);
    for (int k = 0; k < coefficients; ++k) hwy::Prefetch(next + k * group);
    const auto here = [&](int k) { return hn::Load(floats, polynomials + k * group); };
    const auto weight = hn::Set(floats, row_weight) * hn::LoadU(floats, column_weights + x);
    // Outside the image, a comes from the earlier polynomial alone.
    const auto a_weight = hn::IfThenElse(hn::RebindMask(floats, targets.inside), half, one);
    auto a_yy = (here(2) + there[2]) * a_weight;
    auto a_xx = (here(3) + there[3]) * a_weight;
    auto a_xy = (here(4) + there[4]) * (a_weight * half);
    auto b_y = (here(0) - there[0]) * half + (a_yy * dy + a_xy * dx);
    auto b_x = (here(1) - there[1]) * half + (a_xy * dy + a_xx * dx);
    a_yy = a_yy * weight;
    a_xx = a_xx * weight;
    a_xy = a_xy * weight;
    b_y = b_y * weight;
    b_x = b_x * weight;
    const auto xy_squared = a_xy * a_xy;
    const int at = x - left;
    const auto put = [&](int equation, Vector value) {
      float* start = sums.start[equation] + at;
      const auto sum = hn::Load(floats, start) + value;
      const auto end = hn::Load(floats, sums.rows[row + 1][equation] + at);
      hn::Store(sum, floats, start);
      hn::Store(value, floats, sums.rows[row][equation] + at);
      hn::Store(end + sum, floats, window.sums[equation] + Window::before + at);
    };
    put(0, a_yy * a_yy + xy_squared);
    put(1, (a_yy + a_xx) * a_xy);
    put(2, a_xx * a_xx + xy_squared);
    put(3, a_yy * b_y + a_xy * b_x);
    put(4, a_xy * b_y + a_xx * b_x);
  }
}

/// out[x] = row[x] + row[x + 1] + row[x + 2]
void add_threes(const float* row, int width, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto at = [&](int x) { return hn::LoadU(floats, row + x); };
  for (int x = 0; x < width; x += lanes) hn::Store(at(x) + at(x + 1) + at(x + 2), floats, out + x);
}

/// Adds up every third of fifteen pixels: out[x] = row[x] + row[x + 3] + ... + row[x + 12]
void add_fives(const float* row, int width, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto at = [&](int x) { return hn::LoadU(floats, row + x); };
  for (int x = 0; x < width; x += lanes) {
    const auto first = at(x) + at(x + 3);
    const auto last = at(x + 9) + at(x + 12);
    hn::Store(first + at(x + 6) + last, floats, out + x);
  }
}

/// Solves the equations of a row of windows. Products of sums nearly cancel at straight edges, so
/// they are computed in double.
void solve(const EquationRows<strip>& sums, int width, Flow* flow) {
  const hn::CappedTag<double, 8> doubles;
  const hn::Rebind<float, decltype(doubles)> floats;
  using Doubles = hn::Vec<decltype(doubles)>;
  const int lanes = static_cast<int>(hn::Lanes(doubles));
  // The flow is 0 where there is no texture.
  constexpr int count = window_rows * FlowUpdate::window_columns;
  const auto regular = hn::Set(doubles, FlowUpdate::regularization * count * count);
  for (int x = 0; x < width; x += lanes) {
    const auto sum = [&](int equation) {
      return hn::PromoteTo(doubles, hn::Load(floats, sums[equation] + x));
    };
    const auto difference = [](Doubles a, Doubles b, Doubles c, Doubles d) {
      return a * b - c * d;
    };
    const auto g_yy = sum(0);
    const auto g_xy = sum(1);
    const auto g_xx = sum(2);
    const auto h_y = sum(3);
    const auto h_x = sum(4);
    const auto rounded = [&](Doubles value) { return hn::DemoteTo(floats, value); };
    const auto determinant = rounded(difference(g_yy, g_xx, g_xy, g_xy) + regular);
    const auto inverse = hn::Set(floats, 1.0F) / determinant;
    hn::StoreInterleaved2(rounded(difference(g_yy, h_x, g_xy, h_y)) * inverse,
                          rounded(difference(g_xx, h_y, g_xy, h_x)) * inverse, floats, &flow[x].x);
  }
}

/// Solves columns [first, last) of a row from the sums of columns [left, right), a strip; the
/// border of the image is replicated. `edge` holds the last sums of the strip to the left, and is
/// overwritten with the last sums of this strip.
void solve_strip(Window& window, int left, int right, int first, int last, int width, float* edge,
                 Flow* flow) {
  constexpr int before = Window::before;
  const int count = last - first;
  HWY_ALIGN EquationRows<strip> threes;
  HWY_ALIGN EquationRows<strip> sums;
  for (int equation = 0; equation < equations; ++equation) {
    float* row = window.sums[equation];
    float* end = row + before + (right - left);
    if (left == 0)
      std::fill_n(row, before, row[before]);
    else
      std::copy_n(edge, before, row);
    if (right == width) std::fill_n(end, reach, end[-1]);
    std::copy_n(end - before, before, edge);
    edge += before;
    add_threes(row + (first - left) + before - reach, count + FlowUpdate::window_columns - 3,
               threes[equation]);
  }
  for (int equation = 0; equation < equations; ++equation)
    add_fives(threes[equation], count, sums[equation]);
  solve(sums, count, flow + first);
}

void update_block(const PolynomialExpansion& from, const PolynomialExpansion& to,
                  const FlowRows& flow, int first, int last, int block, const float* column_weights,
                  const float* row_weights, FlowUpdate::Scratch& scratch, const FlowRows& out) {
  constexpr int margin = FlowUpdate::margin;
  constexpr int row_reach = FlowUpdate::row_reach;
  const int width = from.width();
  const int rows = FlowUpdate::rows(from.height());
  const int start = block * window_rows;
  const int end = std::min(start + window_rows, rows + 2 * row_reach);
  const int begin = std::max(first - margin, 0) & -PolynomialExpansion::group;
  const int stop = std::min(last + margin, width);
  RowSums* sums =
      scratch_of(scratch.sums, static_cast<std::size_t>((stop - begin + strip - 1) / strip));
  float* edges = scratch_of(scratch.edges, std::size_t{window_rows} * equations * row_padding);
  Window windows[2];
  for (int left = begin; left < stop; left += strip) {
    const int right = std::min(left + strip, stop);
    // The windows of the other columns reach into the next strip.
    const int solved_first = left == begin ? first : left - margin;
    const int solved_last = right == stop ? last : right - margin;
    std::fill_n(sums->start[0], equations * strip, 0.0F);
    // Solves each row after adding the next one's equations, when its sums have reached the cache.
    for (int i = start; i <= end; ++i) {
      if (i < end) {
        const int row = std::clamp(i - row_reach, 0, rows - 1);  // the border is replicated
        const int y = row * FlowUpdate::row_step;
        add_row(from, to, flow.row(row), y, left, right, row_weights[y], column_weights, i - start,
                *sums, windows[i % 2]);
      }
      const int last_row = i - 1;
      if (last_row < std::max(start, 2 * row_reach)) continue;
      solve_strip(windows[last_row % 2], left, right, solved_first, solved_last, width,
                  edges + std::ptrdiff_t{last_row - start} * equations * row_padding,
                  out.row(last_row - 2 * row_reach));
    }
    complete_block(*sums++);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(update_block);

namespace {

/// Polynomials near the border, fitted to replicated pixels, weigh less.
std::vector<float> border_weights(int length) {
  constexpr float weights[FlowUpdate::border] = {0.14F, 0.14F, 0.4472F, 0.4472F, 0.4472F};
  std::vector<float> result(static_cast<std::size_t>(length) + row_padding, 1.0F);
  for (int i = 0; i < std::min(FlowUpdate::border, length); ++i) {
    result[i] *= weights[i];
    result[length - 1 - i] *= weights[i];
  }
  return result;
}

}  // namespace

FlowUpdate::FlowUpdate(int width, int height)
    : column_weights_(border_weights(width)), row_weights_(border_weights(height)) {}

void FlowUpdate::run(const PolynomialExpansion& from, const PolynomialExpansion& to,
                     const FlowRows& flow, int first, int last, int block, Scratch& scratch,
                     const FlowRows& out) const {
  if (block < 0 || block >= blocks(from.height())) return;
  HWY_DYNAMIC_DISPATCH(update_block)
  (from, to, flow, first, last, block, column_weights_.data(), row_weights_.data(), scratch, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
