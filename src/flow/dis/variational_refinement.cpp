// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/variational_refinement.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/dis/variational_refinement.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Vector = hn::Vec<Floats>;
using Field = VariationalRefinement::Field;
using Constraints = VariationalRefinement::Constraints;
using Scratch = VariationalRefinement::Scratch;
using EquationRows = SplitPlanes<VariationalRefinement::max_coefficients>;

// Weights of the terms of the energy, halved because the penalties are square roots.
constexpr float smoothness = 20.0F / 2;
constexpr float brightness = 5.0F / 2;
constexpr float gradient = 10.0F / 2;
/// Squares of what keeps quotients finite.
constexpr float min_gradient = 0.1F * 0.1F;
constexpr float min_residual = 0.001F * 0.001F;
constexpr float over_relaxation = 1.6F;
constexpr int half_sweeps = 2 * 5;  ///< per evaluation of the penalties
/// Positions in the later image are rounded to a fraction of a pixel.
constexpr float fractions = 32;

HWY_INLINE Vector load(const float* values) {
  return hn::LoadU(Floats(), values);
}
HWY_INLINE void store(Vector value, float* out) {
  hn::StoreU(value, Floats(), out);
}
HWY_INLINE Vector set(float value) {
  return hn::Set(Floats(), value);
}
HWY_INLINE Vector square(Vector value) {
  return hn::Mul(value, value);
}

/// The columns to the left of those of a parity; those to the right follow each of them.
template <class Plane>
HWY_INLINE auto* beside(Plane& plane, int parity, int y) {
  return parity == 0 ? plane.row(1, y) - 1 : plane.row(0, y);
}

/// A row of a plane and its neighbours, from the first column of a parity on.
struct Neighbours {
  Neighbours(const SplitPlane& plane, int parity, int y, int y_above, int y_below)
      : here(plane.row(parity, y)),
        side(beside(plane, parity, y)),
        above(plane.row(parity, y_above)),
        below(plane.row(parity, y_below)) {}

  HWY_INLINE Vector left(int k) const { return load(side + k); }
  HWY_INLINE Vector right(int k) const { return load(side + k + 1); }
  /// Differences between the neighbours of a pixel.
  HWY_INLINE Vector across(int k) const { return hn::Sub(right(k), left(k)); }
  HWY_INLINE Vector along(int k) const { return hn::Sub(load(below + k), load(above + k)); }

  const float* here;
  const float* side;
  const float* above;
  const float* below;
};

int ring(int y) {
  return y & (Scratch::rows - 1);
}

/// Linearises the images at a flow.
class Linearisation {
 public:
  Linearisation(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, const Field& flow,
                Scratch& scratch, Constraints& out)
      : from_(from), to_(to), flow_(flow), scratch_(scratch), out_(out), end_(from.height() - 1) {}

  /// Rows [first, last).
  void run(int first, int last) {
    int warped = std::max(0, first - 2);
    int sloped = std::max(0, first - 1);
    for (int y = first; y < last; ++y) {
      for (; warped <= std::min(y + 2, end_); ++warped) warp(warped);
      for (; sloped <= std::min(y + 1, end_); ++sloped) slope(sloped);
      linearise(y);
    }
  }

 private:
  int above(int y) const { return ring(std::max(y - 1, 0)); }
  int below(int y) const { return ring(std::min(y + 1, end_)); }

  /// Rounds and limits positions in the later image.
  static HWY_INLINE Vector place(Vector exact, int size) {
    const auto rounded = hn::Mul(hn::Round(hn::Mul(exact, set(fractions))), set(1 / fractions));
    return hn::Min(hn::Max(rounded, set(0.0F)), set(static_cast<float>(size - 1)));
  }
  static HWY_INLINE Vector between(Vector a, Vector b, Vector weight) {
    return hn::Add(a, hn::Mul(weight, hn::Sub(b, a)));
  }
  static HWY_INLINE Vector pixels(const std::uint8_t* from) {
    const hn::RebindToSigned<Floats> ints;
    const hn::Rebind<std::uint8_t, Floats> bytes;
    return hn::ConvertTo(Floats(), hn::PromoteTo(ints, hn::Load(bytes, from)));
  }

  /// Computes the mean and the difference of the earlier image and the later one, moved back.
  void warp(int y) {
    for (int parity = 0; parity < 2; ++parity) warp(y, parity);
    scratch_.mean.replicate_ends(ring(y));
    scratch_.change.replicate_ends(ring(y));
  }
  void warp(int y, int parity) {
    const Floats floats;
    const hn::RebindToSigned<Floats> ints;
    constexpr int max_lanes = hn::MaxLanes(floats);
    const int lanes = static_cast<int>(hn::Lanes(floats));
    const auto iota = hn::Mul(hn::Iota(floats, 0.0F), set(2.0F));
    const std::uint8_t* here = from_.row(y) + parity;
    const auto stride = to_.stride();
    const std::uint8_t* data = to_.row(0);
    const float* flow_x = flow_.x.row(parity, y);
    const float* flow_y = flow_.y.row(parity, y);
    float* mean = scratch_.mean.row(parity, ring(y));
    float* change = scratch_.change.row(parity, ring(y));
    HWY_ALIGN std::int32_t columns[max_lanes];
    HWY_ALIGN std::int32_t rows[max_lanes];
    HWY_ALIGN std::uint8_t upper_left[max_lanes];
    HWY_ALIGN std::uint8_t upper_right[max_lanes];
    HWY_ALIGN std::uint8_t lower_left[max_lanes];
    HWY_ALIGN std::uint8_t lower_right[max_lanes];
    HWY_ALIGN std::uint8_t earlier[max_lanes];
    for (int k = 0; k < flow_.x.count(parity); k += lanes) {
      const auto start = hn::Add(iota, set(static_cast<float>(2 * k + parity)));
      const auto to_x = place(hn::Add(start, load(flow_x + k)), to_.width());
      const auto to_y = place(hn::Add(set(static_cast<float>(y)), load(flow_y + k)), to_.height());
      const auto cell_x = hn::Floor(to_x);
      const auto cell_y = hn::Floor(to_y);
      hn::Store(hn::ConvertTo(ints, cell_x), ints, columns);
      hn::Store(hn::ConvertTo(ints, cell_y), ints, rows);
      for (int lane = 0; lane < lanes; ++lane) {
        const std::uint8_t* upper = data + rows[lane] * stride + columns[lane];
        const std::uint8_t* lower = upper + stride;
        upper_left[lane] = upper[0];
        upper_right[lane] = upper[1];
        lower_left[lane] = lower[0];
        lower_right[lane] = lower[1];
        earlier[lane] = here[std::ptrdiff_t{2} * (k + lane)];
      }
      const auto right = hn::Sub(to_x, cell_x);
      const auto there =
          between(between(pixels(upper_left), pixels(upper_right), right),
                  between(pixels(lower_left), pixels(lower_right), right), hn::Sub(to_y, cell_y));
      const auto grey = pixels(earlier);
      store(hn::Mul(hn::Add(grey, there), set(0.5F)), mean + k);
      store(hn::Sub(there, grey), change + k);
    }
  }

  Neighbours neighbours(const SplitPlane& plane, int parity, int y) const {
    return {plane, parity, ring(y), above(y), below(y)};
  }

  void slope(int y) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const auto mean = neighbours(scratch_.mean, parity, y);
      float* x = scratch_.slope.x.row(parity, ring(y));
      float* y_ = scratch_.slope.y.row(parity, ring(y));
      for (int k = 0; k < flow_.x.count(parity); k += lanes) {
        store(mean.across(k), x + k);
        store(mean.along(k), y_ + k);
      }
    }
    scratch_.slope.x.replicate_ends(ring(y));
  }

  /// Stores a constraint.
  static HWY_INLINE void put(Vector a, Vector b, Vector c, float* out) {
    const auto size = hn::Add(hn::Add(square(a), square(b)), set(min_gradient));
    const auto scale = hn::Div(set(1.0F), hn::Sqrt(size));
    store(hn::Mul(a, scale), out);
    store(hn::Mul(b, scale), out + Constraints::block);
    store(hn::Mul(c, scale), out + 2 * Constraints::block);
  }

  void linearise(int y) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const auto slope_x = neighbours(scratch_.slope.x, parity, y);
      const auto slope_y = neighbours(scratch_.slope.y, parity, y);
      const auto change = neighbours(scratch_.change, parity, y);
      float* constraints = out_.row(parity, y);
      for (int k = 0; k < flow_.x.count(parity); k += lanes) {
        const auto xy = slope_x.along(k);
        float* out = constraints + Constraints::at(k);
        put(load(slope_x.here + k), load(slope_y.here + k), load(change.here + k), out);
        put(slope_x.across(k), xy, change.across(k), out + 3 * Constraints::block);
        put(xy, slope_y.along(k), change.along(k), out + 6 * Constraints::block);
      }
    }
  }

  const Image<std::uint8_t>& from_;
  const Image<std::uint8_t>& to_;
  const Field& flow_;
  Scratch& scratch_;
  Constraints& out_;
  int end_;
};

void linearise_rows(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                    const Field& flow, int first, int last, Scratch& scratch, Constraints& out) {
  Linearisation(from, to, flow, scratch, out).run(first, last);
}

/// Evaluates the penalties at a step, and improves the step.
class Relaxation {
 public:
  Relaxation(const Field& flow, const Constraints& constraints, const Field& step, Scratch& scratch,
             Field& out)
      : flow_(flow),
        constraints_(constraints),
        step_(step),
        scratch_(scratch),
        out_(out),
        width_(flow.x.width()),
        height_(flow.x.height()) {}

  /// Rows [first, last). A half sweep of a row follows the previous half sweep of the next row, so
  /// all of them are done in one pass over rows that stay in the cache.
  void run(int first, int last) {
    constexpr int reach = half_sweeps - 1;
    const int begin = std::max(0, first - reach);
    const int end = std::min(height_, last + reach);
    load_row(begin - 1);
    load_row(begin);
    couple(begin - 1);
    for (int y = begin; y < last + reach; ++y) {
      if (y < end) {
        load_row(y + 1);
        couple(y);
        assemble(y);
      }
      for (int i = 0; i < half_sweeps; ++i) {
        const int row = y - i;
        const int beside = reach - i;
        if (row >= std::max(0, first - beside) && row < std::min(height_, last + beside))
          relax(row, (row + i) & 1);
      }
      if (y - reach >= first) store_row(y - reach);
    }
  }

 private:
  void load_row(int y) {
    const int to = ring(y);
    if (y < 0 || y >= height_) {
      scratch_.step.x.clear_row(to);
      scratch_.step.y.clear_row(to);
      return;
    }
    load_row(step_.x, flow_.x, y, scratch_.step.x, scratch_.total.x);
    load_row(step_.y, flow_.y, y, scratch_.step.y, scratch_.total.y);
  }
  static void load_row(const SplitPlane& step, const SplitPlane& flow, int y, SplitPlane& row,
                       SplitPlane& total) {
    const int to = ring(y);
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const float* from_step = step.row(parity, y);
      const float* from_flow = flow.row(parity, y);
      float* to_row = row.row(parity, to);
      float* to_total = total.row(parity, to);
      const int count = flow.count(parity);
      for (int k = 0; k < count; k += lanes) {
        const auto values = load(from_step + k);
        store(values, to_row + k);
        store(hn::Add(load(from_flow + k), values), to_total + k);
      }
      store(set(0.0F), to_row + count);  // nothing pulls from outside the image
    }
    total.replicate_ends(to);
  }

  /// Computes how much pixels pull at each other: little where the flow changes much.
  void couple(int y) {
    const int here = ring(y);
    if (y < 0) {
      scratch_.down.clear_row(here);
      return;
    }
    const int below = y + 1 < height_ ? ring(y + 1) : here;
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const Neighbours x(scratch_.total.x, parity, here, here, below);
      const Neighbours y_(scratch_.total.y, parity, here, here, below);
      float* right = scratch_.right.row(parity, here);
      float* down = scratch_.down.row(parity, here);
      for (int k = 0; k < flow_.x.count(parity); k += lanes) {
        const auto size = hn::Add(hn::Add(squares(x, k), squares(y_, k)), set(min_residual));
        const auto weight = hn::Div(set(smoothness), hn::Sqrt(size));
        store(weight, right + k);
        store(weight, down + k);
      }
    }
    scratch_.right.row((width_ - 1) & 1, here)[(width_ - 1) / 2] = 0;
    if (y + 1 == height_) scratch_.down.clear_row(here);
  }

  /// Squares of the differences from the neighbours to the right and below.
  static HWY_INLINE Vector squares(const Neighbours& total, int k) {
    const auto value = load(total.here + k);
    return hn::Add(square(hn::Sub(total.right(k), value)),
                   square(hn::Sub(load(total.below + k), value)));
  }

  /// Constraint of a vector of pixels.
  struct Term {
    explicit HWY_INLINE Term(const float* from)
        : a(load(from)),
          b(load(from + Constraints::block)),
          c(load(from + 2 * Constraints::block)) {}
    HWY_INLINE Vector residual(Vector step_x, Vector step_y) const {
      return hn::Add(hn::Add(c, hn::Mul(a, step_x)), hn::Mul(b, step_y));
    }
    Vector a;
    Vector b;
    Vector c;
  };

  /// Equations of a vector of pixels.
  struct Equations {
    // Not in the declarations: GCC 12 compiles these without the target's instructions.
    HWY_INLINE Equations() : xx(set(min_gradient)), xy(set(0.0F)), yy(xx), x(xy), y(xy) {}
    HWY_INLINE void add(const Term& term, Vector weight) {
      const auto a = hn::Mul(weight, term.a);
      const auto b = hn::Mul(weight, term.b);
      xx = hn::Add(xx, hn::Mul(a, term.a));
      xy = hn::Add(xy, hn::Mul(a, term.b));
      yy = hn::Add(yy, hn::Mul(b, term.b));
      x = hn::Sub(x, hn::Mul(a, term.c));
      y = hn::Sub(y, hn::Mul(b, term.c));
    }
    Vector xx;
    Vector xy;
    Vector yy;
    Vector x;
    Vector y;
  };

  static HWY_INLINE Vector weight(float factor, Vector squares) {
    return hn::Div(set(factor), hn::Sqrt(hn::Add(squares, set(min_residual))));
  }

  /// What the neighbours' flows add to the equations.
  static HWY_INLINE Vector pull(const Neighbours& flow, int k, Vector left, Vector right,
                                Vector above, Vector below) {
    const auto value = load(flow.here + k);
    return hn::Add(hn::Add(hn::Mul(left, hn::Sub(flow.left(k), value)),
                           hn::Mul(right, hn::Sub(flow.right(k), value))),
                   hn::Add(hn::Mul(above, hn::Sub(load(flow.above + k), value)),
                           hn::Mul(below, hn::Sub(load(flow.below + k), value))));
  }

  /// Computes the equations of a row.
  void assemble(int y) {
    for (int parity = 0; parity < 2; ++parity) assemble(y, parity);
  }
  void assemble(int y, int parity) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    const int here = ring(y);
    const int y_above = std::max(y - 1, 0);
    const int y_below = std::min(y + 1, height_ - 1);
    const Neighbours flow_x(flow_.x, parity, y, y_above, y_below);
    const Neighbours flow_y(flow_.y, parity, y, y_above, y_below);
    const float* constraints = constraints_.row(parity, y);
    const float* step_x_row = scratch_.step.x.row(parity, here);
    const float* step_y_row = scratch_.step.y.row(parity, here);
    const float* beside_row = beside(scratch_.right, parity, here);
    const float* right = scratch_.right.row(parity, here);
    const float* above = scratch_.down.row(parity, ring(y - 1));
    const float* below = scratch_.down.row(parity, here);
    float* out = scratch_.equations.row(parity, here);
    for (int k = 0; k < flow_.x.count(parity); k += lanes) {
      const auto step_x = load(step_x_row + k);
      const auto step_y = load(step_y_row + k);
      const float* constraint = constraints + Constraints::at(k);
      Equations equations;
      const Term bright(constraint);
      equations.add(bright, weight(brightness, square(bright.residual(step_x, step_y))));
      const Term gradient_x(constraint + 3 * Constraints::block);
      const Term gradient_y(constraint + 6 * Constraints::block);
      const auto gradient_weight =
          weight(gradient, hn::Add(square(gradient_x.residual(step_x, step_y)),
                                   square(gradient_y.residual(step_x, step_y))));
      equations.add(gradient_x, gradient_weight);
      equations.add(gradient_y, gradient_weight);
      const auto by_left = load(beside_row + k);
      const auto by_right = load(right + k);
      const auto by_above = load(above + k);
      const auto by_below = load(below + k);
      const auto all = hn::Add(hn::Add(by_left, by_right), hn::Add(by_above, by_below));
      const auto pull_x = pull(flow_x, k, by_left, by_right, by_above, by_below);
      const auto pull_y = pull(flow_y, k, by_left, by_right, by_above, by_below);
      const auto xx = hn::Add(equations.xx, all);
      const auto yy = hn::Add(equations.yy, all);
      const auto inverse = hn::Div(set(1.0F), hn::Mul(xx, yy));
      float* to = out + EquationRows::at(k);
      store(equations.xy, to + VariationalRefinement::cross * EquationRows::block);
      store(hn::Mul(yy, inverse), to + VariationalRefinement::inverse_x * EquationRows::block);
      store(hn::Mul(xx, inverse), to + VariationalRefinement::inverse_y * EquationRows::block);
      store(hn::Add(equations.x, pull_x),
            to + VariationalRefinement::constant_x * EquationRows::block);
      store(hn::Add(equations.y, pull_y),
            to + VariationalRefinement::constant_y * EquationRows::block);
    }
  }

  /// Solves an equation, and goes further. `other` is the term of the other component.
  static HWY_INLINE Vector solve(const Neighbours& steps, int k, Vector old, Vector other,
                                 Vector constant, Vector inverse, Vector left, Vector right,
                                 Vector up, Vector down) {
    auto sum = hn::Add(hn::Mul(left, steps.left(k)), hn::Mul(right, steps.right(k)));
    sum = hn::Add(sum, hn::Mul(up, load(steps.above + k)));
    sum = hn::Add(sum, hn::Mul(down, load(steps.below + k)));
    sum = hn::Sub(hn::Add(sum, constant), other);
    const auto solution = hn::Mul(sum, inverse);
    return hn::Add(old, hn::Mul(set(over_relaxation), hn::Sub(solution, old)));
  }

  /// Improves the steps of the pixels of a parity in a row.
  void relax(int y, int parity) {
    const int here = ring(y);
    const int up = ring(y - 1);
    const int down = ring(y + 1);
    const float* weight_left = beside(scratch_.right, parity, here);
    const float* weight_right = scratch_.right.row(parity, here);
    const float* weight_up = scratch_.down.row(parity, up);
    const float* weight_down = scratch_.down.row(parity, here);
    const float* equations = scratch_.equations.row(parity, here);
    float* x = scratch_.step.x.row(parity, here);
    float* y_ = scratch_.step.y.row(parity, here);
    const Neighbours steps_x(scratch_.step.x, parity, here, up, down);
    const Neighbours steps_y(scratch_.step.y, parity, here, up, down);
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    const int count = flow_.x.count(parity);
    for (int k = 0; k < count; k += lanes) {
      const float* equation = equations + EquationRows::at(k);
      const auto by_left = load(weight_left + k);
      const auto by_right = load(weight_right + k);
      const auto by_up = load(weight_up + k);
      const auto by_down = load(weight_down + k);
      const auto cross = load(equation + VariationalRefinement::cross * EquationRows::block);
      const auto inverse_x =
          load(equation + VariationalRefinement::inverse_x * EquationRows::block);
      const auto inverse_y =
          load(equation + VariationalRefinement::inverse_y * EquationRows::block);
      const auto constant_x =
          load(equation + VariationalRefinement::constant_x * EquationRows::block);
      const auto constant_y =
          load(equation + VariationalRefinement::constant_y * EquationRows::block);
      const auto old_x = load(x + k);
      const auto old_y = load(y_ + k);
      const auto new_x = solve(steps_x, k, old_x, hn::Mul(old_y, cross), constant_x, inverse_x,
                               by_left, by_right, by_up, by_down);
      const auto new_y = solve(steps_y, k, old_y, hn::Mul(new_x, cross), constant_y, inverse_y,
                               by_left, by_right, by_up, by_down);
      store(new_x, x + k);
      store(new_y, y_ + k);
    }
    x[count] = 0;
    y_[count] = 0;
  }

  void store_row(int y) {
    store_row(scratch_.step.x, y, out_.x);
    store_row(scratch_.step.y, y, out_.y);
  }
  static void store_row(const SplitPlane& step, int y, SplitPlane& out) {
    for (int parity = 0; parity < 2; ++parity)
      std::copy_n(step.row(parity, ring(y)), step.count(parity), out.row(parity, y));
  }

  const Field& flow_;
  const Constraints& constraints_;
  const Field& step_;
  Scratch& scratch_;
  Field& out_;
  int width_;
  int height_;
};

void relax_rows(const Field& flow, const Constraints& constraints, const Field& step, int first,
                int last, Scratch& scratch, Field& out) {
  Relaxation(flow, constraints, step, scratch, out).run(first, last);
}

/// Interleaves flow plus step.
void merge_row(const Field& flow, const Field& step, int y, Flow* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto sum = [&](const SplitPlane& a, const SplitPlane& b, int parity, int k) {
    return hn::Add(load(a.row(parity, y) + k), load(b.row(parity, y) + k));
  };
  for (int k = 0; k < flow.x.count(0); k += lanes) {
    const auto even_x = sum(flow.x, step.x, 0, k);
    const auto even_y = sum(flow.y, step.y, 0, k);
    const auto odd_x = sum(flow.x, step.x, 1, k);
    const auto odd_y = sum(flow.y, step.y, 1, k);
    hn::StoreInterleaved4(even_x, even_y, odd_x, odd_y, floats, &out[std::ptrdiff_t{2} * k].x);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(linearise_rows);
HWY_EXPORT(relax_rows);
HWY_EXPORT(merge_row);

namespace {

constexpr int evaluations = 5;

/// Rows around a band are computed twice, so there are as few bands as keep the threads busy.
int band_count_for(int height, int threads) {
  constexpr int min_rows = 24;
  return std::clamp(height / min_rows, 1, threads);
}

}  // namespace

VariationalRefinement::VariationalRefinement(int width, int height)
    : flow_(width, height),
      steps_{Field(width, height), Field(width, height)},
      constraints_(width, height) {}

void VariationalRefinement::run(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                                ThreadPool& threads) {
  while (scratch_.size() < static_cast<std::size_t>(threads.threads()))
    scratch_.emplace_back(width());
  const int bands = band_count_for(height(), threads.threads());
  const auto for_each_band = [&](const auto& body) {
    threads.for_each(bands, [&](int band, int thread) {
      body(height() * band / bands, height() * (band + 1) / bands, scratch_[thread]);
    });
  };
  for_each_band([&](int first, int last, Scratch& scratch) {
    HWY_DYNAMIC_DISPATCH(linearise_rows)(from, to, flow_, first, last, scratch, constraints_);
    for (int y = first; y < last; ++y) {
      steps_[0].x.clear_row(y);
      steps_[0].y.clear_row(y);
    }
  });
  for (int i = 0; i < evaluations; ++i) {
    for_each_band([&](int first, int last, Scratch& scratch) {
      HWY_DYNAMIC_DISPATCH(relax_rows)
      (flow_, constraints_, steps_[0], first, last, scratch, steps_[1]);
    });
    std::swap(steps_[0], steps_[1]);
  }
}

void VariationalRefinement::row(int y, Flow* out) const {
  HWY_DYNAMIC_DISPATCH(merge_row)(flow_, steps_[0], y, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
