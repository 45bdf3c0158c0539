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
constexpr int half_sweeps = 2 * 5;      ///< per evaluation of the penalties
constexpr int reach = half_sweeps - 1;  ///< rows to the farthest that affects a row
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

/// 1 / sqrt(value) with a relative error below 1e-6: an estimate from the bits of the exponent, and
/// two steps of Newton's method, the first with the factors that are best for one step. Faster than
/// a square root and a division.
HWY_INLINE Vector inverse_sqrt(Vector value) {
  const hn::RebindToSigned<Floats> ints;
  const auto bits = hn::ShiftRight<1>(hn::BitCast(ints, value));
  auto root = hn::BitCast(Floats(), hn::Sub(hn::Set(ints, 0x5F1FFFF9), bits));
  root = hn::Mul(hn::Mul(root, set(0.703952253F)),
                 hn::Sub(set(2.38924456F), hn::Mul(hn::Mul(value, root), root)));
  const auto half = hn::Mul(value, set(0.5F));
  return hn::Mul(root, hn::Sub(set(1.5F), hn::Mul(hn::Mul(half, root), root)));
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
  using Ints = hn::RebindToSigned<Floats>;

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
  /// The mean of two neighbours, each the low and the high byte of a word.
  static HWY_INLINE Vector along(const std::uint16_t* words, Vector weight) {
    const auto both = hn::PromoteTo(Ints(), hn::Load(hn::Rebind<std::uint16_t, Floats>(), words));
    return between(hn::ConvertTo(Floats(), hn::And(both, hn::Set(Ints(), 0xFF))),
                   hn::ConvertTo(Floats(), hn::ShiftRight<8>(both)), weight);
  }

  /// Computes the mean and the difference of the earlier image and the later one, moved back.
  void warp(int y) {
    for (int parity = 0; parity < 2; ++parity) warp(y, parity);
    scratch_.mean.replicate_ends(ring(y));
    scratch_.change.replicate_ends(ring(y));
  }
  void warp(int y, int parity) {
    const Floats floats;
    const Ints ints;
    const hn::Rebind<std::uint8_t, Floats> bytes;
    constexpr int max_lanes = hn::MaxLanes(floats);
    const int lanes = static_cast<int>(hn::Lanes(floats));
    const auto iota = hn::Mul(hn::Iota(floats, 0.0F), set(2.0F));
    const std::uint8_t* here = from_.row(y);
    const auto stride = static_cast<std::int32_t>(to_.stride());
    const std::uint8_t* data = to_.row(0);
    const float* flow_x = flow_.x.row(parity, y);
    const float* flow_y = flow_.y.row(parity, y);
    float* mean = scratch_.mean.row(parity, ring(y));
    float* change = scratch_.change.row(parity, ring(y));
    HWY_ALIGN std::int32_t offsets[max_lanes];
    HWY_ALIGN std::uint16_t upper[max_lanes];
    HWY_ALIGN std::uint16_t lower[max_lanes];
    for (int k = 0; k < flow_.x.count(parity); k += lanes) {
      const auto start = hn::Add(iota, set(static_cast<float>(2 * k + parity)));
      const auto to_x = place(hn::Add(start, load(flow_x + k)), to_.width());
      const auto to_y = place(hn::Add(set(static_cast<float>(y)), load(flow_y + k)), to_.height());
      const auto cell_x = hn::Floor(to_x);
      const auto cell_y = hn::Floor(to_y);
      hn::Store(hn::Add(hn::Mul(hn::ConvertTo(ints, cell_y), hn::Set(ints, stride)),
                        hn::ConvertTo(ints, cell_x)),
                ints, offsets);
      for (int lane = 0; lane < lanes; ++lane) {
        const std::uint8_t* pixels = data + offsets[lane];
        const std::uint8_t* below = pixels + stride;
        upper[lane] = static_cast<std::uint16_t>(pixels[0] | pixels[1] << 8);
        lower[lane] = static_cast<std::uint16_t>(below[0] | below[1] << 8);
      }
      const auto right = hn::Sub(to_x, cell_x);
      const auto there = between(along(upper, right), along(lower, right), hn::Sub(to_y, cell_y));
      hn::Vec<decltype(bytes)> columns[2];
      hn::LoadInterleaved2(bytes, here + std::ptrdiff_t{2} * k, columns[0], columns[1]);
      const auto grey = hn::ConvertTo(floats, hn::PromoteTo(ints, columns[parity]));
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

  /// Stores a constraint on the flow, from one on the step from the given flow.
  static HWY_INLINE void put(Vector a, Vector b, Vector c, Vector flow_x, Vector flow_y,
                             float* out) {
    const auto scale = inverse_sqrt(hn::Add(hn::Add(square(a), square(b)), set(min_gradient)));
    const auto at_0 = hn::Sub(c, hn::Add(hn::Mul(a, flow_x), hn::Mul(b, flow_y)));
    store(hn::Mul(a, scale), out);
    store(hn::Mul(b, scale), out + Constraints::block);
    store(hn::Mul(at_0, scale), out + 2 * Constraints::block);
  }

  void linearise(int y) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const auto slope_x = neighbours(scratch_.slope.x, parity, y);
      const auto slope_y = neighbours(scratch_.slope.y, parity, y);
      const auto change = neighbours(scratch_.change, parity, y);
      const float* flow_x_row = flow_.x.row(parity, y);
      const float* flow_y_row = flow_.y.row(parity, y);
      float* constraints = out_.row(parity, y);
      for (int k = 0; k < flow_.x.count(parity); k += lanes) {
        const auto flow_x = load(flow_x_row + k);
        const auto flow_y = load(flow_y_row + k);
        const auto xy = slope_x.along(k);
        float* out = constraints + Constraints::at(k);
        put(load(slope_x.here + k), load(slope_y.here + k), load(change.here + k), flow_x, flow_y,
            out);
        put(slope_x.across(k), xy, change.across(k), flow_x, flow_y, out + 3 * Constraints::block);
        put(xy, slope_y.along(k), change.along(k), flow_x, flow_y, out + 6 * Constraints::block);
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

/// Evaluates the penalties at a flow, and improves the flow.
class Relaxation {
 public:
  Relaxation(const Constraints& constraints, const Field& start, const Field& flow, int first,
             int last, Scratch& scratch, Field& out)
      : constraints_(constraints),
        start_(start),
        flow_(flow),
        first_(first),
        last_(last),
        scratch_(scratch),
        out_(out),
        width_(flow.x.width()),
        height_(flow.x.height()) {}

  /// A half sweep of a row follows the previous half sweep of the next row, so all of them are done
  /// in one pass over rows that stay in the cache.
  void run() {
    const int begin = std::max(0, first_ - reach);
    const int end = std::min(height_, last_ + reach);
    load_row(begin - 1);
    load_row(begin);
    couple(begin - 1);
    for (int y = begin; y < last_ + reach; ++y) {
      if (y < end) {
        load_row(y + 1);
        couple(y);
        for (int parity = 0; parity < 2; ++parity) assemble(y, parity);
      }
      relax(y);
      if (y - reach >= first_) store_row(y - reach);
    }
  }

 private:
  void load_row(int y) {
    const int to = ring(y);
    const auto load_component = [&](const SplitPlane& from, SplitPlane& row) {
      if (y < 0 || y >= height_) {
        row.clear_row(to);
        return;
      }
      row.copy_row(to, from, y);
      row.replicate_ends(to);
    };
    load_component(flow_.x, scratch_.flow.x);
    load_component(flow_.y, scratch_.flow.y);
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
      const Neighbours x(scratch_.flow.x, parity, here, here, below);
      const Neighbours y_(scratch_.flow.y, parity, here, here, below);
      float* right = scratch_.right.row(parity, here);
      float* down = scratch_.down.row(parity, here);
      for (int k = 0; k < flow_.x.count(parity); k += lanes) {
        const auto by = weight(smoothness, hn::Add(squares(x, k), squares(y_, k)));
        store(by, right + k);
        store(by, down + k);
      }
    }
    scratch_.right.row((width_ - 1) & 1, here)[(width_ - 1) / 2] = 0;
    if (y + 1 == height_) scratch_.down.clear_row(here);
  }

  /// Squares of the differences from the neighbours to the right and below.
  static HWY_INLINE Vector squares(const Neighbours& flow, int k) {
    const auto value = load(flow.here + k);
    return hn::Add(square(hn::Sub(flow.right(k), value)),
                   square(hn::Sub(load(flow.below + k), value)));
  }

  /// Constraint of a vector of pixels.
  struct Term {
    explicit HWY_INLINE Term(const float* from)
        : a(load(from)),
          b(load(from + Constraints::block)),
          c(load(from + 2 * Constraints::block)) {}
    HWY_INLINE Vector residual(Vector x, Vector y) const {
      return hn::Add(hn::Add(c, hn::Mul(a, x)), hn::Mul(b, y));
    }
    Vector a;
    Vector b;
    Vector c;
  };

  struct PixelConstraints {
    explicit HWY_INLINE PixelConstraints(const float* from)
        : bright(from),
          gradient_x(from + 3 * Constraints::block),
          gradient_y(from + 6 * Constraints::block) {}
    Term bright;
    Term gradient_x;
    Term gradient_y;
  };

  /// Equations of a vector of pixels.
  struct Equations {
    // Not in the declarations: GCC 12 compiles these without the target's instructions.
    HWY_INLINE Equations(Vector start_x, Vector start_y)
        : xx(set(min_gradient)),
          xy(set(0.0F)),
          yy(xx),
          x(hn::Mul(xx, start_x)),
          y(hn::Mul(xx, start_y)) {}
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
    return hn::Mul(set(factor), inverse_sqrt(hn::Add(squares, set(min_residual))));
  }

  /// Computes the equations of a row. Each depends on a long sequence of operations, so it is split
  /// in two stages, of which the processor overlaps the vectors of a few columns.
  void assemble(int y, int parity) {
    constexpr int columns = 2 * row_padding;
    HWY_ALIGN float bright_weights[columns];
    HWY_ALIGN float gradient_weights[columns];
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    const int here = ring(y);
    const float* constraints = constraints_.row(parity, y);
    const float* start_x = start_.x.row(parity, y);
    const float* start_y = start_.y.row(parity, y);
    const float* x_row = scratch_.flow.x.row(parity, here);
    const float* y_row = scratch_.flow.y.row(parity, here);
    const float* left = beside(scratch_.right, parity, here);
    const float* right = scratch_.right.row(parity, here);
    const float* above = scratch_.down.row(parity, ring(y - 1));
    const float* below = scratch_.down.row(parity, here);
    float* out = scratch_.equations.row(parity, here);
    for (int first = 0; first < flow_.x.count(parity); first += columns) {
      for (int i = 0; i < columns; i += lanes) {
        const int k = first + i;
        const auto x = load(x_row + k);
        const auto y_ = load(y_row + k);
        const PixelConstraints constraint(constraints + Constraints::at(k));
        store(weight(brightness, square(constraint.bright.residual(x, y_))), bright_weights + i);
        store(weight(gradient, hn::Add(square(constraint.gradient_x.residual(x, y_)),
                                       square(constraint.gradient_y.residual(x, y_)))),
              gradient_weights + i);
      }
      for (int i = 0; i < columns; i += lanes) {
        const int k = first + i;
        const PixelConstraints constraint(constraints + Constraints::at(k));
        Equations equations(load(start_x + k), load(start_y + k));
        const auto gradient_weight = load(gradient_weights + i);
        equations.add(constraint.bright, load(bright_weights + i));
        equations.add(constraint.gradient_x, gradient_weight);
        equations.add(constraint.gradient_y, gradient_weight);
        const auto all = hn::Add(hn::Add(load(left + k), load(right + k)),
                                 hn::Add(load(above + k), load(below + k)));
        const auto xx = hn::Add(equations.xx, all);
        const auto yy = hn::Add(equations.yy, all);
        const auto inverse = hn::Div(set(over_relaxation), hn::Mul(xx, yy));
        float* to = out + EquationRows::at(k);
        store(equations.xy, to + VariationalRefinement::cross * EquationRows::block);
        store(hn::Mul(yy, inverse), to + VariationalRefinement::inverse_x * EquationRows::block);
        store(hn::Mul(xx, inverse), to + VariationalRefinement::inverse_y * EquationRows::block);
        store(equations.x, to + VariationalRefinement::constant_x * EquationRows::block);
        store(equations.y, to + VariationalRefinement::constant_y * EquationRows::block);
      }
    }
  }

  /// Every other pixel of a row.
  struct Pixels {
    Pixels() = default;
    Pixels(Scratch& scratch, int parity, int row)
        : x(scratch.flow.x.row(parity, row)),
          y(scratch.flow.y.row(parity, row)),
          beside_x(beside(scratch.flow.x, parity, row)),
          beside_y(beside(scratch.flow.y, parity, row)),
          left(beside(scratch.right, parity, row)),
          right(scratch.right.row(parity, row)),
          down(scratch.down.row(parity, row)),
          equations(scratch.equations.row(parity, row)) {}

    float* x;
    float* y;
    const float* beside_x;
    const float* beside_y;
    const float* left;
    const float* right;
    const float* down;
    const float* equations;
  };

  /// Improves a vector of pixels in one row after the other, upwards.
  class Climb {
   public:
    HWY_INLINE Climb(const Pixels& below, const Pixels& row, int k)
        : below_x_(load(below.x + k)),
          below_y_(load(below.y + k)),
          x_(load(row.x + k)),
          y_(load(row.y + k)),
          down_(load(row.down + k)) {}

    HWY_INLINE void improve(const Pixels& row, const Pixels& above, int k) {
      const float* equation = row.equations + EquationRows::at(k);
      const auto coefficient = [&](int which) HWY_ATTR {
        return load(equation + which * EquationRows::block);
      };
      const auto above_x = load(above.x + k);
      const auto above_y = load(above.y + k);
      const auto up = load(above.down + k);
      const auto left = load(row.left + k);
      const auto right = load(row.right + k);
      // What the row below adds comes last: it has just been computed.
      const auto pull = [&](const float* beside, Vector above_flow, Vector constant,
                            Vector below_flow) HWY_ATTR {
        const auto along =
            hn::Add(hn::Mul(left, load(beside + k)), hn::Mul(right, load(beside + k + 1)));
        const auto sum = hn::Add(hn::Add(along, constant), hn::Mul(up, above_flow));
        return hn::Add(sum, hn::Mul(down_, below_flow));
      };
      const auto cross = coefficient(VariationalRefinement::cross);
      const auto keep = set(1 - over_relaxation);
      const auto pull_x = pull(
          row.beside_x, above_x,
          hn::Sub(coefficient(VariationalRefinement::constant_x), hn::Mul(cross, y_)), below_x_);
      const auto pull_y =
          pull(row.beside_y, above_y, coefficient(VariationalRefinement::constant_y), below_y_);
      below_x_ = hn::Add(hn::Mul(keep, x_),
                         hn::Mul(pull_x, coefficient(VariationalRefinement::inverse_x)));
      below_y_ = hn::Add(hn::Mul(keep, y_), hn::Mul(hn::Sub(pull_y, hn::Mul(cross, below_x_)),
                                                    coefficient(VariationalRefinement::inverse_y)));
      store(below_x_, row.x + k);
      store(below_y_, row.y + k);
      x_ = above_x;
      y_ = above_y;
      down_ = up;
    }

   private:
    Vector below_x_;
    Vector below_y_;
    Vector x_;
    Vector y_;
    Vector down_;
  };

  /// Half sweep i of row y - i, for every i: the same columns of all these rows. Most of what a row
  /// needs has just been loaded for the row below it, if a few columns are improved in all of them
  /// at a time. Two vectors at a time, because each row waits for the one below it.
  void relax(int y) {
    const int begin = std::max(0, y - height_ + 1);
    const int end = std::min({half_sweeps, y + 1, (y - first_ + reach) / 2 + 1});
    const int parity = y & 1;
    Pixels rows[half_sweeps + 1];
    for (int i = begin; i <= end; ++i) rows[i] = Pixels(scratch_, parity, ring(y - i));
    const Pixels below(scratch_, parity, ring(y - begin + 1));
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    const int count = flow_.x.count(parity);
    for (int k = 0; k < count; k += 2 * lanes) {
      Climb left(below, rows[begin], k);
      Climb right(below, rows[begin], k + lanes);
      for (int i = begin; i < end; ++i) {
        left.improve(rows[i], rows[i + 1], k);
        right.improve(rows[i], rows[i + 1], k + lanes);
      }
    }
    for (int i = begin; i < end; ++i) rows[i].x[count] = rows[i].y[count] = 0;  // outside the image
  }

  void store_row(int y) {
    out_.x.copy_row(y, scratch_.flow.x, ring(y));
    out_.y.copy_row(y, scratch_.flow.y, ring(y));
  }

  const Constraints& constraints_;
  const Field& start_;
  const Field& flow_;
  int first_;
  int last_;
  Scratch& scratch_;
  Field& out_;
  int width_;
  int height_;
};

/// Rows [first, last).
void relax_rows(const Constraints& constraints, const Field& start, const Field& flow, int first,
                int last, Scratch& scratch, Field& out) {
  Relaxation(constraints, start, flow, first, last, scratch, out).run();
}

/// Interleaves the components of a row.
void merge_row(const Field& flow, int y, Flow* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int k = 0; k < flow.x.count(0); k += lanes)
    hn::StoreInterleaved4(load(flow.x.row(0, y) + k), load(flow.y.row(0, y) + k),
                          load(flow.x.row(1, y) + k), load(flow.y.row(1, y) + k), floats,
                          &out[std::ptrdiff_t{2} * k].x);
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
    : start_(width, height),
      flows_{Field(width, height), Field(width, height)},
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
    HWY_DYNAMIC_DISPATCH(linearise_rows)
    (from, to, start_, first, last, scratch, constraints_);
  });
  for (int i = 0; i < evaluations; ++i) {
    const Field& flow = i == 0 ? start_ : flows_[0];
    for_each_band([&](int first, int last, Scratch& scratch) {
      HWY_DYNAMIC_DISPATCH(relax_rows)
      (constraints_, start_, flow, first, last, scratch, flows_[1]);
    });
    std::swap(flows_[0], flows_[1]);
  }
}

void VariationalRefinement::row(int y, Flow* out) const {
  HWY_DYNAMIC_DISPATCH(merge_row)(flows_[0], y, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
