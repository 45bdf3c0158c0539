// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/variational_refinement.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#define HWY_TARGET_INCLUDE "src/flow/dis/variational_refinement.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Vector = hn::Vec<Floats>;
using Ints = hn::RebindToSigned<Floats>;
using Field = VariationalRefinement::Field;
using Derivatives = VariationalRefinement::Derivatives;
using Scratch = VariationalRefinement::Scratch;
using EquationRows = SplitPlanes<VariationalRefinement::max_coefficients>;

// Weights of the terms of the energy, halved because the penalties are square roots.
constexpr float smoothness = 20.0F / 2;
constexpr float brightness = 5.0F / 2;
constexpr float gradient = 10.0F / 2;
/// Squared regularisation constants.
constexpr float min_gradient = 0.1F * 0.1F;
constexpr float min_residual = 0.001F * 0.001F;
constexpr float over_relaxation = 1.6F;
constexpr int half_sweeps = 2 * 5;      ///< per evaluation of the penalties
constexpr int reach = half_sweeps - 1;  ///< distance to the farthest row that affects a row
/// Positions in the later image are rounded to 1/fractions of a pixel.
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
  return value * value;
}

/// 1 / sqrt(value) with a relative error below 1e-6: an estimate from the bits of the exponent, and
/// two steps of Newton's method, the first with factors optimised for a single step. Faster than a
/// square root and a division.
HWY_INLINE Vector inverse_sqrt(Vector value) {
  const Ints ints;
  const auto bits = hn::ShiftRight<1>(hn::BitCast(ints, value));
  auto root = hn::BitCast(Floats(), hn::Set(ints, 0x5F1FFFF9) - bits);
  root = root * set(0.703952253F) * (set(2.38924456F) - value * root * root);
  const auto half = value * set(0.5F);
  return root * (set(1.5F) - half * root * root);
}

/// Left neighbours of the columns of a parity; their right neighbours are one element further.
template <class Plane>
HWY_INLINE auto* left_of(Plane& plane, int parity, int y) {
  return parity == 0 ? plane.row(1, y) - 1 : plane.row(0, y);
}

/// A row of a plane and its neighbours, from the first column of a parity on.
struct Neighbours {
  Neighbours(const SplitPlane& plane, int parity, int y, int y_above, int y_below)
      : here(plane.row(parity, y)),
        side(left_of(plane, parity, y)),
        above(plane.row(parity, y_above)),
        below(plane.row(parity, y_below)) {}

  HWY_INLINE Vector left(int k) const { return load(side + k); }
  HWY_INLINE Vector right(int k) const { return load(side + k + 1); }
  /// Differences between the neighbours of a pixel.
  HWY_INLINE Vector across(int k) const { return right(k) - left(k); }
  HWY_INLINE Vector along(int k) const { return load(below + k) - load(above + k); }

  const float* here;
  const float* side;
  const float* above;
  const float* below;
};

int ring(int y) {
  return y & (Scratch::rows - 1);
}

/// Computes the derivatives of the earlier image and the later one, warped back along a flow.
struct Linearisation {
  const Image<std::uint8_t>& from;
  const Image<std::uint8_t>& to;
  const Field& flow;
  Scratch& scratch;
  Derivatives& out;
  int end = from.height() - 1;  ///< last row

  void run(int first, int last) {
    int warped = std::max(0, first - 1);
    for (int y = first; y < last; ++y) {
      for (; warped <= std::min(y + 1, end); ++warped) warp(warped);
      derive(y);
    }
  }

 private:
  /// Rounds and clamps positions in the later image.
  static HWY_INLINE Vector place(Vector exact, int size) {
    const auto rounded = hn::Round(exact * set(fractions)) * set(1 / fractions);
    return hn::Min(hn::Max(rounded, set(0.0F)), set(static_cast<float>(size - 1)));
  }
  /// Interpolates between the pixels at offsets and their right neighbours, the two lowest bytes of
  /// words.
  static HWY_INLINE Vector along(const std::uint8_t* pixels, hn::Vec<Ints> offsets, Vector weight) {
    const Ints ints;
    const auto words =
        hn::GatherOffset(ints, reinterpret_cast<const std::int32_t*>(pixels), offsets);
    const auto pixel = [&](auto lowest) HWY_ATTR {
      return hn::ConvertTo(Floats(), hn::And(lowest, hn::Set(ints, 0xFF)));
    };
    return lerp(pixel(words), pixel(hn::ShiftRight<8>(words)), weight);
  }

  /// Computes the mean and the difference of the earlier image and the warped later one.
  void warp(int y) {
    for (int parity = 0; parity < 2; ++parity) warp(y, parity);
    scratch.mean.replicate_ends(ring(y));
  }
  void warp(int y, int parity) {
    const Floats floats;
    const Ints ints;
    const hn::Rebind<std::uint8_t, Floats> bytes;
    const int lanes = static_cast<int>(hn::Lanes(floats));
    const auto every_second = iota(floats, 0) * set(2.0F);
    const std::uint8_t* here = from.row(y);
    const auto stride = static_cast<std::int32_t>(to.stride());
    const std::uint8_t* data = to.row(0);
    const float* flow_x = flow.x.row(parity, y);
    const float* flow_y = flow.y.row(parity, y);
    float* mean = scratch.mean.row(parity, ring(y));
    float* change = scratch.change.row(parity, ring(y));
    for (int k = 0; k < flow.x.count(parity); k += lanes) {
      const auto start = every_second + set(static_cast<float>(2 * k + parity));
      const auto to_x = place(start + load(flow_x + k), to.width());
      const auto to_y = place(set(static_cast<float>(y)) + load(flow_y + k), to.height());
      const auto cell_x = hn::Floor(to_x);
      const auto cell_y = hn::Floor(to_y);
      const auto offsets =
          hn::ConvertTo(ints, cell_y) * hn::Set(ints, stride) + hn::ConvertTo(ints, cell_x);
      const auto right = to_x - cell_x;
      const auto there =
          lerp(along(data, offsets, right), along(data + stride, offsets, right), to_y - cell_y);
      hn::Vec<decltype(bytes)> columns[2];
      hn::LoadInterleaved2(bytes, here + std::ptrdiff_t{2} * k, columns[0], columns[1]);
      const auto grey = hn::ConvertTo(floats, hn::PromoteTo(ints, columns[parity]));
      store((grey + there) * set(0.5F), mean + k);
      store(there - grey, change + k);
    }
  }

  void derive(int y) {
    const int here = ring(y);
    const int above = ring(std::max(y - 1, 0));
    const int below = ring(std::min(y + 1, end));
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const Neighbours mean(scratch.mean, parity, here, above, below);
      float* x = out.x.row(parity, y);
      float* y_ = out.y.row(parity, y);
      for (int k = 0; k < flow.x.count(parity); k += lanes) {
        store(mean.across(k), x + k);
        store(mean.along(k), y_ + k);
      }
    }
    out.x.replicate_ends(y);
    out.t.copy_row(y, scratch.change, here);
    out.t.replicate_ends(y);
  }
};

void linearise_rows(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                    const Field& flow, int first, int last, Scratch& scratch, Derivatives& out) {
  Linearisation{from, to, flow, scratch, out}.run(first, last);
}

/// factor / sqrt(squares)
HWY_INLINE Vector weight(float factor, Vector squares) {
  return set(factor) * inverse_sqrt(squares);
}

/// Computes the equations of every other pixel of a row.
class Assembly {
 public:
  Assembly(const Derivatives& derivatives, const Field& start, Scratch& scratch, int y, int parity)
      : dx_(neighbours(derivatives.x, y, parity)),
        dy_(neighbours(derivatives.y, y, parity)),
        dt_(neighbours(derivatives.t, y, parity)),
        start_x_(start.x.row(parity, y)),
        start_y_(start.y.row(parity, y)),
        x_(scratch.flow.x.row(parity, ring(y))),
        y_(scratch.flow.y.row(parity, ring(y))),
        left_(left_of(scratch.weight, parity, ring(y))),
        right_(scratch.right.row(parity, y & 1)),
        above_(scratch.weight.row(parity, ring(y - 1))),
        below_(scratch.weight.row(parity, ring(y + 1 < start.x.height() ? y : y + 1))),
        out_(scratch.equations.row(parity, ring(y))) {}

  /// Processes two vectors at a time, because the operations on each depend on one another.
  void run(int count) const {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int k = 0; k < count; k += 2 * lanes) {
      const Terms terms = terms_at(k);
      const Terms next_terms = terms_at(k + lanes);
      const Equations equations = weighted(terms);
      const Equations next_equations = weighted(next_terms);
      solve(equations, k);
      solve(next_equations, k + lanes);
    }
  }

 private:
  /// a x + b y + c = 0 for a step (x, y) from the start.
  struct Constraint {
    HWY_INLINE Vector residual(Vector x, Vector y) const { return c + a * x + b * y; }
    /// Square of the gradient.
    HWY_INLINE Vector norm() const { return square(a) + square(b) + set(min_gradient); }
    Vector a;
    Vector b;
    Vector c;
  };

  /// Equations of a vector of pixels.
  struct Equations {
    // Not in the declarations: GCC 12 compiles these without the target's instructions.
    HWY_INLINE Equations() : xx(set(min_gradient)), xy(set(0.0F)), yy(xx), x(xy), y(xy) {}
    HWY_INLINE void add(const Constraint& constraint, Vector weight) {
      const auto a = weight * constraint.a;
      const auto b = weight * constraint.b;
      xx = xx + a * constraint.a;
      xy = xy + a * constraint.b;
      yy = yy + b * constraint.b;
      x = x - a * constraint.c;
      y = y - b * constraint.c;
    }
    Vector xx;
    Vector xy;
    Vector yy;
    Vector x;
    Vector y;
  };

  /// Terms of the energy. The square of a residual is divided by its norm, and so is its weight,
  /// factor / sqrt(square + min_residual). To avoid the divisions, both are scaled by the norms.
  struct Terms {
    Constraint bright;
    Constraint gradient_x;
    Constraint gradient_y;
    Vector norm_x;
    Vector norm_y;
    // Arguments of the square roots.
    Vector bright_squares;
    Vector gradient_squares;
  };

  static Neighbours neighbours(const SplitPlane& plane, int y, int parity) {
    return {plane, parity, y, std::max(y - 1, 0), std::min(y + 1, plane.height() - 1)};
  }

  HWY_INLINE Terms terms_at(int k) const {
    const auto x = load(x_ + k) - load(start_x_ + k);
    const auto y = load(y_ + k) - load(start_y_ + k);
    const auto xy = dx_.along(k);
    const Constraint bright = {load(dx_.here + k), load(dy_.here + k), load(dt_.here + k)};
    const Constraint gradient_x = {dx_.across(k), xy, dt_.across(k)};
    const Constraint gradient_y = {xy, dy_.along(k), dt_.along(k)};
    const auto norm = bright.norm();
    const auto norm_x = gradient_x.norm();
    const auto norm_y = gradient_y.norm();
    const auto norms = norm_x * norm_y;
    const auto bright_squares = square(bright.residual(x, y)) + norm * set(min_residual);
    const auto gradient_squares = square(gradient_x.residual(x, y)) * norm_y +
                                  square(gradient_y.residual(x, y)) * norm_x +
                                  norms * set(min_residual);
    return {bright,
            gradient_x,
            gradient_y,
            norm_x,
            norm_y,
            norm * bright_squares,
            norms * gradient_squares};
  }

  static HWY_INLINE Equations weighted(const Terms& terms) {
    Equations equations;
    equations.add(terms.bright, weight(brightness, terms.bright_squares));
    const auto both = weight(gradient, terms.gradient_squares);
    equations.add(terms.gradient_x, both * terms.norm_y);
    equations.add(terms.gradient_y, both * terms.norm_x);
    return equations;
  }

  /// Adds the smoothness terms, and stores the coefficients.
  HWY_INLINE void solve(const Equations& equations, int k) const {
    const auto start_x = load(start_x_ + k);
    const auto start_y = load(start_y_ + k);
    const auto all = load(left_ + k) + load(right_ + k) + (load(above_ + k) + load(below_ + k));
    const auto xx = equations.xx + all;
    const auto yy = equations.yy + all;
    const auto inverse = set(over_relaxation) / (xx * yy);
    const auto constant_x = equations.x + (equations.xx * start_x + equations.xy * start_y);
    const auto constant_y = equations.y + (equations.xy * start_x + equations.yy * start_y);
    float* to = out_ + EquationRows::offset_of(k);
    store(equations.xy, to + VariationalRefinement::cross * EquationRows::block);
    store(yy * inverse, to + VariationalRefinement::inverse_x * EquationRows::block);
    store(xx * inverse, to + VariationalRefinement::inverse_y * EquationRows::block);
    store(constant_x, to + VariationalRefinement::constant_x * EquationRows::block);
    store(constant_y, to + VariationalRefinement::constant_y * EquationRows::block);
  }

  Neighbours dx_;
  Neighbours dy_;
  Neighbours dt_;
  const float* start_x_;
  const float* start_y_;
  const float* x_;
  const float* y_;
  // Smoothness weights of the neighbours.
  const float* left_;
  const float* right_;
  const float* above_;
  const float* below_;
  float* out_;
};

/// Evaluates the penalties at a flow, and relaxes the equations that they give.
struct Relaxation {
  const Derivatives& derivatives;
  const Field& start;
  const Field& flow;
  int first;
  int last;
  Scratch& scratch;
  Field& out;
  int width = flow.x.width();
  int height = flow.x.height();

  /// A half sweep of a row needs only the previous half sweep of the next row, so all of them are
  /// done in one pass over rows that stay in the cache.
  void run() {
    const int begin = std::max(0, first - reach);
    const int end = std::min(height, last + reach);
    load_row(begin - 1);
    load_row(begin);
    for (int y = begin; y < last + reach; ++y) {
      if (y < end) {
        load_row(y + 1);
        for (int parity = 0; parity < 2; ++parity)
          Assembly(derivatives, start, scratch, y, parity).run(flow.x.count(parity));
      }
      relax(y);
      if (y - reach >= first) store_row(y - reach);
    }
  }

 private:
  /// Copies the flow of a row, and computes the smoothness weights between a pixel and its right
  /// and lower neighbours: small where the flow changes much. Outside the image, flow and weights
  /// are 0.
  void load_row(int y) {
    const int to = ring(y);
    if (y < 0 || y >= height) {
      for (auto* plane : {&scratch.flow.x, &scratch.flow.y, &scratch.weight}) plane->clear_row(to);
      return;
    }
    const int below = std::min(y + 1, height - 1);
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int parity = 0; parity < 2; ++parity) {
      const Neighbours x(flow.x, parity, y, y, below);
      const Neighbours y_(flow.y, parity, y, y, below);
      float* x_row = scratch.flow.x.row(parity, to);
      float* y_row = scratch.flow.y.row(parity, to);
      float* weights = scratch.weight.row(parity, to);
      float* right = scratch.right.row(parity, y & 1);
      for (int k = 0; k < flow.x.count(parity); k += lanes) {
        const auto squared = squares(x, k) + squares(y_, k);
        const auto by = weight(smoothness, squared + set(min_residual));
        store(load(x.here + k), x_row + k);
        store(load(y_.here + k), y_row + k);
        store(by, weights + k);
        store(by, right + k);
      }
    }
    scratch.right.at(width - 1, y & 1) = 0;
    clear_past_end(to, width & 1);
  }

  /// Sets the flow past the end of a row to 0.
  void clear_past_end(int row, int parity) {
    const int count = flow.x.count(parity);
    scratch.flow.x.row(parity, row)[count] = scratch.flow.y.row(parity, row)[count] = 0;
  }

  /// Squares of the differences from the neighbours to the right and below.
  static HWY_INLINE Vector squares(const Neighbours& row, int k) {
    const auto value = load(row.here + k);
    return square(row.right(k) - value) + square(load(row.below + k) - value);
  }

  /// Every other pixel of the rows, from the first column on. All these planes have the same offset
  /// from row to row.
  struct Pixels {
    Pixels(Scratch& scratch, int parity)
        : x(scratch.flow.x.row(parity, 0)),
          y(scratch.flow.y.row(parity, 0)),
          weight(scratch.weight.row(parity, 0)),
          to_left(left_of(scratch.weight, parity, 0) - weight) {}

    float* x;
    float* y;
    const float* weight;
    std::ptrdiff_t to_left;  ///< from a pixel to the one on its left
  };

  /// Relaxes a vector of pixels, row by row from the bottom up.
  class UpwardSweep {
   public:
    HWY_INLINE UpwardSweep(const Pixels& pixels, std::ptrdiff_t below, std::ptrdiff_t row)
        : below_x_(load(pixels.x + below)),
          below_y_(load(pixels.y + below)),
          x_(load(pixels.x + row)),
          y_(load(pixels.y + row)),
          weight_(load(pixels.weight + row)) {}

    HWY_INLINE void relax(const Pixels& pixels, std::ptrdiff_t row, std::ptrdiff_t above,
                          const float* equation) {
      const auto coefficient = [&](int which) HWY_ATTR {
        return load(equation + which * EquationRows::block);
      };
      const auto above_x = load(pixels.x + above);
      const auto above_y = load(pixels.y + above);
      const auto up = load(pixels.weight + above);
      const auto left_row = row + pixels.to_left;
      const auto left = load(pixels.weight + left_row);
      // Adds the row below last, because it has just been computed.
      const auto smoothed = [&](const float* beside, Vector above_flow, Vector constant,
                                Vector below_flow) HWY_ATTR {
        const auto along = left * load(beside) + weight_ * load(beside + 1);
        const auto sum = along + constant + up * above_flow;
        return sum + weight_ * below_flow;
      };
      const auto cross = coefficient(VariationalRefinement::cross);
      const auto keep = set(1 - over_relaxation);
      const auto sum_x =
          smoothed(pixels.x + left_row, above_x,
                   coefficient(VariationalRefinement::constant_x) - cross * y_, below_x_);
      const auto sum_y = smoothed(pixels.y + left_row, above_y,
                                  coefficient(VariationalRefinement::constant_y), below_y_);
      below_x_ = keep * x_ + sum_x * coefficient(VariationalRefinement::inverse_x);
      below_y_ =
          keep * y_ + (sum_y - cross * below_x_) * coefficient(VariationalRefinement::inverse_y);
      store(below_x_, pixels.x + row);
      store(below_y_, pixels.y + row);
      x_ = above_x;
      y_ = above_y;
      weight_ = up;
    }

   private:
    Vector below_x_;
    Vector below_y_;
    Vector x_;
    Vector y_;
    Vector weight_;
  };

  /// Runs half sweep i of row y - i, for each i. A few columns pass through all these rows at a
  /// time, because a row needs mostly what has just been loaded for the row below it. Two vectors
  /// at a time, because their dependent operations then overlap.
  void relax(int y) {
    const int begin = std::max(0, y - height + 1);
    const int end = std::min({half_sweeps, y + 1, (y - first + reach) / 2 + 1});
    const int parity = y & 1;
    const Pixels pixels(scratch, parity);
    std::ptrdiff_t rows[half_sweeps + 1];
    const float* equations[half_sweeps + 1];
    for (int i = begin; i <= end; ++i) {
      rows[i] = scratch.weight.offset(ring(y - i));
      equations[i] = scratch.equations.row(parity, ring(y - i));
    }
    const auto below = scratch.weight.offset(ring(y - begin + 1));
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    const int count = flow.x.count(parity);
    for (int k = 0; k < count; k += 2 * lanes) {
      const auto at = EquationRows::offset_of(k);
      const auto next = EquationRows::offset_of(k + lanes);
      UpwardSweep left(pixels, below + k, rows[begin] + k);
      UpwardSweep right(pixels, below + k + lanes, rows[begin] + k + lanes);
      for (int i = begin; i < end; ++i) {
        left.relax(pixels, rows[i] + k, rows[i + 1] + k, equations[i] + at);
        right.relax(pixels, rows[i] + k + lanes, rows[i + 1] + k + lanes, equations[i] + next);
      }
    }
    for (int i = begin; i < end; ++i) clear_past_end(ring(y - i), parity);
  }

  void store_row(int y) {
    out.x.copy_row(y, scratch.flow.x, ring(y));
    out.y.copy_row(y, scratch.flow.y, ring(y));
    out.x.replicate_ends(y);
    out.y.replicate_ends(y);
  }
};

/// Rows [first, last).
void relax_rows(const Derivatives& derivatives, const Field& start, const Field& flow, int first,
                int last, Scratch& scratch, Field& out) {
  Relaxation{derivatives, start, flow, first, last, scratch, out}.run();
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

/// Number of bands: as few as keep the threads busy, because rows around a band are computed twice.
int band_count_for(int height, int threads) {
  constexpr int min_rows = 24;
  return std::clamp(height / min_rows, 1, threads);
}

}  // namespace

VariationalRefinement::VariationalRefinement(int width, int height)
    : start_(width, height),
      flows_{Field(width, height), Field(width, height)},
      derivatives_(width, height) {}

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
    (from, to, start_, first, last, scratch, derivatives_);
  });
  for (int i = 0; i < evaluations; ++i) {
    const Field& flow = i == 0 ? start_ : flows_[0];
    for_each_band([&](int first, int last, Scratch& scratch) {
      HWY_DYNAMIC_DISPATCH(relax_rows)
      (derivatives_, start_, flow, first, last, scratch, flows_[1]);
    });
    std::swap(flows_[0], flows_[1]);
  }
}

void VariationalRefinement::row(int y, Flow* out) const {
  HWY_DYNAMIC_DISPATCH(merge_row)(flows_[0], y, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
