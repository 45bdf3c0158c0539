// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/flow_update.hpp"

#include <algorithm>

#include "src/flow/scratch.hpp"

#undef HWY_TARGET_INCLUDE
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
constexpr int coefficients = PolynomialExpansion::coefficients;
/// Coefficients of the normal equations: symmetric 2x2 matrix and right-hand side.
constexpr int equations = 5;

/// Pixels of a row that are processed together.
constexpr int chunk = 64;

/// Intermediate values per pixel of a chunk.
struct Chunk {
  HWY_ALIGN std::int32_t offset[chunk];  ///< of the later polynomials, at the end of the flow
  HWY_ALIGN float right[chunk];          ///< sub-pixel offset from that pixel
  HWY_ALIGN float down[chunk];
  HWY_ALIGN float weight[chunk];        ///< 1 / number of polynomials that a is a mean of
  HWY_ALIGN float four[4 * chunk + 4];  ///< earlier b - later b, earlier a + later a
  HWY_ALIGN float fifth[chunk];
};

/// Follows the flow to the later polynomials. There is none outside the image: a zero one is read,
/// and the earlier one's a counts twice.
void follow(const PolynomialExpansion& to, const Flow* flow, int x, int y, int count,
            Chunk& result) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto zero = hn::Zero(floats);
  const auto right_end = hn::Set(floats, static_cast<float>(to.width() - 1));
  const auto lower_end = hn::Set(floats, static_cast<float>(to.height() - 1));
  const auto stride = hn::Set(Words(), to.stride());
  const auto nowhere = hn::Set(Words(), to.stride() * to.height());
  const auto py = hn::Set(floats, static_cast<float>(y));
  for (int i = 0; i < count; i += lanes) {
    Vector dx;
    Vector dy;
    hn::LoadInterleaved2(floats, &flow[x + i].x, dx, dy);
    const auto to_x = hn::Add(hn::Iota(floats, static_cast<float>(x + i)), dx);
    const auto to_y = hn::Add(py, dy);
    const auto inside = hn::And(hn::And(hn::Ge(to_x, zero), hn::Le(to_x, right_end)),
                                hn::And(hn::Ge(to_y, zero), hn::Le(to_y, lower_end)));
    const auto in_x = hn::IfThenElseZero(inside, to_x);
    const auto in_y = hn::IfThenElseZero(inside, to_y);
    const auto x0 = hn::ConvertTo(Words(), in_x);
    const auto y0 = hn::ConvertTo(Words(), in_y);
    const auto x5 = hn::Add(hn::ShiftLeft<2>(x0), x0);
    const auto offset = hn::Add(hn::Mul(y0, stride), x5);
    const auto is_inside = hn::RebindMask(Words(), inside);
    hn::Store(hn::IfThenElse(is_inside, offset, nowhere), Words(), result.offset + i);
    hn::Store(hn::Sub(in_x, hn::ConvertTo(floats, x0)), floats, result.right + i);
    hn::Store(hn::Sub(in_y, hn::ConvertTo(floats, y0)), floats, result.down + i);
    hn::Store(hn::IfThenElse(inside, hn::Set(floats, 0.5F), hn::Set(floats, 1.0F)), floats,
              result.weight + i);
  }
}

/// Combines the later polynomials, interpolated bilinearly, with the earlier ones.
void combine(const float* from, const PolynomialExpansion& to, int count, Chunk& result) {
  HWY_ALIGN static constexpr float signs[8] = {-1, -1, 1, 1, 1, 1, 1, 1};
  const float* upper_row = to.row(0);
  const float* lower_row = to.row(1);
  const auto combined = [&](auto tag, int i, int k) {
    const float* upper = upper_row + result.offset[i] + k;
    const float* lower = lower_row + result.offset[i] + k;
    const auto down = hn::Set(tag, result.down[i]);
    const auto between = [](auto a, auto b, auto weight) {
      return hn::Add(a, hn::Mul(weight, hn::Sub(b, a)));
    };
    const auto left = between(hn::LoadU(tag, upper), hn::LoadU(tag, lower), down);
    const auto right =
        between(hn::LoadU(tag, upper + coefficients), hn::LoadU(tag, lower + coefficients), down);
    const auto there = between(left, right, hn::Set(tag, result.right[i]));
    return hn::Add(hn::LoadU(tag, from + std::ptrdiff_t{coefficients} * i + k),
                   hn::Mul(hn::LoadU(tag, signs + k), there));
  };
  const hn::CappedTag<float, 8> eight;
  const hn::CappedTag<float, 4> four;
  const int quarter = static_cast<int>(hn::Lanes(four));
  for (int i = 0; i < count; ++i) {
    float* out = result.four + std::ptrdiff_t{4} * i;
    if (hn::Lanes(eight) == 8) {  // the next pixel overwrites the upper four
      hn::StoreU(combined(eight, i, 0), eight, out);
      result.fifth[i] = out[4];
    } else {
      for (int k = 0; k < 4; k += quarter) hn::StoreU(combined(four, i, k), four, out + k);
      result.fifth[i] = hn::GetLane(combined(hn::CappedTag<float, 1>(), i, 4));
    }
  }
}

/// Ring buffers of three rows of equations, and of thirteen rows of their sums over three rows.
struct Rows {
  int padded_width;  ///< floats per row of one equation
  float* tensors;
  float* threes;
  float* window;  ///< sums over fifteen rows, each with `reach` pixels before and after

  float* tensor_row(int i) const {
    return tensors + std::ptrdiff_t{i % 3} * equations * padded_width;
  }
  float* three_row(int i) const {
    return threes + std::ptrdiff_t{i % 13} * equations * padded_width;
  }
};

/// Computes the i-th row of equations, those of image row y, and the sums over the last fifteen
/// rows, which are valid from the fifteenth row on.
void add_row(const PolynomialExpansion& from, const PolynomialExpansion& to, const Flow* flow,
             int y, float row_weight, const float* column_weights, int i, const Rows& rows,
             Chunk& pixels) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  float* tensor = rows.tensor_row(i);
  const float* tensor_1 = rows.tensor_row(i + 2);
  const float* tensor_2 = rows.tensor_row(i + 1);
  float* three = rows.three_row(i);
  const float* earlier_threes[4];
  for (int k = 0; k < 4; ++k) earlier_threes[k] = rows.three_row(i + 13 - 3 * (4 - k));
  float* window = rows.window + FlowUpdate::reach;
  const std::ptrdiff_t padded_width = rows.padded_width;
  for (int left = 0; left < from.width(); left += chunk) {
    const int count = std::min(chunk, from.width() - left);
    follow(to, flow, left, y, count, pixels);
    combine(from.row(y) + std::ptrdiff_t{coefficients} * left, to, count, pixels);
    for (int j = 0; j < count; j += lanes) {
      const int x = left + j;
      Vector b_y;
      Vector b_x;
      Vector a_yy;
      Vector a_xx;
      Vector dx;
      Vector dy;
      hn::LoadInterleaved4(floats, pixels.four + std::ptrdiff_t{4} * j, b_y, b_x, a_yy, a_xx);
      hn::LoadInterleaved2(floats, &flow[x].x, dx, dy);
      const auto half = hn::Set(floats, 0.5F);
      const auto weight =
          hn::Mul(hn::Set(floats, row_weight), hn::LoadU(floats, column_weights + x));
      const auto a_weight = hn::Load(floats, pixels.weight + j);
      a_yy = hn::Mul(a_yy, a_weight);
      a_xx = hn::Mul(a_xx, a_weight);
      auto a_xy = hn::Mul(hn::Load(floats, pixels.fifth + j), hn::Mul(a_weight, half));
      b_y = hn::Add(hn::Mul(b_y, half), hn::Add(hn::Mul(a_yy, dy), hn::Mul(a_xy, dx)));
      b_x = hn::Add(hn::Mul(b_x, half), hn::Add(hn::Mul(a_xy, dy), hn::Mul(a_xx, dx)));
      a_yy = hn::Mul(a_yy, weight);
      a_xx = hn::Mul(a_xx, weight);
      a_xy = hn::Mul(a_xy, weight);
      b_y = hn::Mul(b_y, weight);
      b_x = hn::Mul(b_x, weight);
      const auto xy_squared = hn::Mul(a_xy, a_xy);
      const auto put = [&](int equation, Vector value) {
        // The five equations of a vector of pixels are adjacent, so one address serves all.
        const std::ptrdiff_t at = std::ptrdiff_t{equations} * x + std::ptrdiff_t{equation} * lanes;
        const auto recent = [&](const float* row) { return hn::LoadU(floats, row + at); };
        const auto sum = hn::Add(hn::Add(recent(tensor_2), recent(tensor_1)), value);
        hn::StoreU(value, floats, tensor + at);
        hn::StoreU(sum, floats, three + at);
        auto all = hn::Add(recent(earlier_threes[0]), recent(earlier_threes[1]));
        all = hn::Add(hn::Add(all, recent(earlier_threes[2])), recent(earlier_threes[3]));
        hn::StoreU(hn::Add(all, sum), floats, window + equation * padded_width + x);
      };
      put(0, hn::Add(hn::Mul(a_yy, a_yy), xy_squared));
      put(1, hn::Mul(hn::Add(a_yy, a_xx), a_xy));
      put(2, hn::Add(hn::Mul(a_xx, a_xx), xy_squared));
      put(3, hn::Add(hn::Mul(a_yy, b_y), hn::Mul(a_xy, b_x)));
      put(4, hn::Add(hn::Mul(a_xy, b_y), hn::Mul(a_xx, b_x)));
    }
  }
}

/// out[x] = row[x] + row[x + 1] + row[x + 2]
void add_threes(const float* row, int width, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < width; x += lanes)
    hn::StoreU(hn::Add(hn::Add(hn::LoadU(floats, row + x), hn::LoadU(floats, row + x + 1)),
                       hn::LoadU(floats, row + x + 2)),
               floats, out + x);
}

/// Solves for the flow of a row. `threes` are the sums of the equations over fifteen rows and three
/// pixels. At straight edges the products of sums nearly cancel, so they are computed in double.
void solve_row(const float* threes, int padded_width, int width, Flow* flow) {
  const hn::CappedTag<double, 8> doubles;
  const hn::Rebind<float, decltype(doubles)> floats;
  using Doubles = hn::Vec<decltype(doubles)>;
  const int lanes = static_cast<int>(hn::Lanes(doubles));
  constexpr int side = 2 * FlowUpdate::reach + 1;
  // Regularization: the flow is 0 where there is no texture.
  const auto regular = hn::Set(doubles, 1e-3 * side * side * side * side);
  for (int x = 0; x < width; x += lanes) {
    const auto window = [&](int equation) {
      const float* row = threes + std::ptrdiff_t{equation} * padded_width + x;
      auto sum = hn::LoadU(floats, row);
      for (int k = 3; k < side; k += 3) sum = hn::Add(sum, hn::LoadU(floats, row + k));
      return hn::PromoteTo(doubles, sum);
    };
    const auto difference = [](Doubles a, Doubles b, Doubles c, Doubles d) {
      return hn::Sub(hn::Mul(a, b), hn::Mul(c, d));
    };
    const auto g_yy = window(0);
    const auto g_xy = window(1);
    const auto g_xx = window(2);
    const auto h_y = window(3);
    const auto h_x = window(4);
    const auto inverse =
        hn::Div(hn::Set(doubles, 1.0), hn::Add(difference(g_yy, g_xx, g_xy, g_xy), regular));
    hn::StoreInterleaved2(hn::DemoteTo(floats, hn::Mul(difference(g_yy, h_x, g_xy, h_y), inverse)),
                          hn::DemoteTo(floats, hn::Mul(difference(g_xx, h_y, g_xy, h_x), inverse)),
                          floats, &flow[x].x);
  }
}

void solve_window(const Rows& rows, int width, float* threes, Flow* flow) {
  for (int equation = 0; equation < equations; ++equation) {
    const std::ptrdiff_t at = std::ptrdiff_t{equation} * rows.padded_width;
    float* window = rows.window + at + FlowUpdate::reach;
    std::fill_n(window - FlowUpdate::reach, FlowUpdate::reach, window[0]);
    std::fill_n(window + width, FlowUpdate::reach, window[width - 1]);
    add_threes(rows.window + at, width + 2 * FlowUpdate::reach - 2, threes + at);
  }
  solve_row(threes, rows.padded_width, width, flow);
}

void update_rows(const PolynomialExpansion& from, const PolynomialExpansion& to,
                 const FlowRows& flow, int first, int last, const float* column_weights,
                 const float* row_weights, FlowUpdate::Scratch& scratch, const FlowRows& out) {
  const int padded_width = from.width() + 2 * FlowUpdate::reach + row_padding;
  const auto row_size =
      static_cast<std::size_t>(equations) * static_cast<std::size_t>(padded_width);
  const Rows rows{padded_width, scratch_of(scratch.tensors, 3 * row_size),
                  scratch_of(scratch.threes, 13 * row_size),
                  scratch_of(scratch.window_rows, row_size)};
  float* row_threes = scratch_of(scratch.row_threes, row_size);
  Chunk pixels{};
  const int before = first - FlowUpdate::reach;
  for (int i = 0; before + i < last + FlowUpdate::reach; ++i) {
    const int y = std::clamp(before + i, 0, from.height() - 1);  // the border is replicated
    add_row(from, to, flow.row(y), y, row_weights[y], column_weights, i, rows, pixels);
    if (i >= 2 * FlowUpdate::reach)
      solve_window(rows, from.width(), row_threes, out.row(before + i - FlowUpdate::reach));
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(update_rows);

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
                     const FlowRows& flow, int first, int last, Scratch& scratch,
                     const FlowRows& out) const {
  HWY_DYNAMIC_DISPATCH(update_rows)
  (from, to, flow, first, last, column_weights_.data(), row_weights_.data(), scratch, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
