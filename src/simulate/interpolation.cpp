// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/interpolation.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "src/flow/flow_range.hpp"

#define HWY_TARGET_INCLUDE "src/simulate/interpolation.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Tile size: the pixels of a tile are skipped together or not at all. Vectors are capped at its
/// width.
constexpr int tile_width = 16;
constexpr int tile_height = 4;
static_assert(rows_per_band % tile_height == 0);

using Words = hn::CappedTag<std::int32_t, tile_width>;
using Floats = hn::CappedTag<float, tile_width>;
using Bytes = hn::Rebind<std::uint8_t, Words>;
using Vector = hn::Vec<Words>;

/// Bilinear sample positions for a vector of positions in 1/65536 of a pixel.
struct SamplePlaces {
  Vector x0;  ///< upper-left pixel
  Vector y0;
  Vector right;  ///< offset from it, 1/64 of a pixel
  Vector down;

  SamplePlaces(Vector x, Vector y, Vector right_end, Vector lower_end) {
    const auto zero = hn::Zero(Words());
    const auto half = hn::Set(Words(), 512);
    const auto low_bits = hn::Set(Words(), 63);
    const auto qx = hn::Min(hn::Max(hn::ShiftRight<10>(x + half), zero), right_end);
    const auto qy = hn::Min(hn::Max(hn::ShiftRight<10>(y + half), zero), lower_end);
    x0 = hn::ShiftRight<6>(qx);
    y0 = hn::ShiftRight<6>(qy);
    right = hn::And(qx, low_bits);
    down = hn::And(qy, low_bits);
  }
};

/// Vector version of sample() in warp.hpp. Needs the view of an Image.
class Sampler {
 public:
  explicit Sampler(const ImageView<std::uint8_t>& frame)
      : pixels_(reinterpret_cast<const std::int32_t*>(frame.data)),
        stride_(hn::Set(Words(), static_cast<std::int32_t>(frame.stride))),
        right_end_(hn::Set(Words(), (frame.width - 1) * 64)),
        lower_end_(hn::Set(Words(), (frame.height - 1) * 64)),
        last_row_(hn::Set(Words(), frame.height - 1)) {}

  /// Positions in 1/65536 of a pixel; samples in 1/4096 of a grey level.
  Vector at(Vector x, Vector y) const {
    const SamplePlaces at(x, y, right_end_, lower_end_);
    const auto y1 = hn::Min(at.y0 + hn::Set(Words(), 1), last_row_);
    const auto upper = between(at.y0 * stride_ + at.x0, at.right);
    const auto lower = between(y1 * stride_ + at.x0, at.right);
    return hn::ShiftLeft<6>(upper) + (lower - upper) * at.down;
  }

 private:
  /// Interpolates between a pixel and its right neighbour (weight 0 at the right border), in 1/64
  /// of a grey level.
  Vector between(Vector offset, Vector right) const {
    const auto byte = hn::Set(Words(), 255);
    const auto pixels = hn::GatherOffset(Words(), pixels_, offset);
    const auto a = hn::And(pixels, byte);
    const auto b = hn::And(hn::ShiftRight<8>(pixels), byte);
    return hn::ShiftLeft<6>(a) + (b - a) * right;
  }

  const std::int32_t* pixels_;
  Vector stride_;
  Vector right_end_;
  Vector lower_end_;
  Vector last_row_;
};

/// The same samples from an image that pairs each pixel with the one below it: one gather per
/// sample.
class PairSampler {
 public:
  /// `pairs` has each pixel in the low byte and the one below it in the high byte.
  explicit PairSampler(const ImageView<std::uint16_t>& pairs)
      : pairs_(reinterpret_cast<const std::int32_t*>(pairs.data)),
        stride_(hn::Set(Words(), static_cast<std::int32_t>(pairs.stride))),
        right_end_(hn::Set(Words(), (pairs.width - 1) * 64)),
        lower_end_(hn::Set(Words(), (pairs.height - 1) * 64)) {}

  Vector at(Vector x, Vector y) const {
    const SamplePlaces at(x, y, right_end_, lower_end_);
    const auto offset = at.y0 * stride_ + (at.x0 + at.x0);
    const auto pairs = hn::GatherOffset(Words(), pairs_, offset);
    // Left and right column in 16 bits each, which no sum exceeds.
    const auto bytes = hn::Set(Words(), 0x00FF00FF);
    const auto upper = hn::And(pairs, bytes);
    const auto lower = hn::And(hn::ShiftRight<8>(pairs), bytes);
    const auto columns = upper * (hn::Set(Words(), 64) - at.down) + lower * at.down;
    const auto left = hn::And(columns, hn::Set(Words(), 0xFFFF));
    const auto right = hn::ShiftRight<16>(columns);
    return hn::ShiftLeft<6>(left) + (right - left) * at.right;
  }

 private:
  const std::int32_t* pairs_;
  Vector stride_;
  Vector right_end_;
  Vector lower_end_;
};

/// A vector of pixels moving with the flow.
struct MovingPixels {
  Vector x;  ///< positions, 1/65536 of a pixel
  Vector y;
  Vector dx;  ///< displacement per step, same as motion_per_step()
  Vector dy;

  MovingPixels(const ImageView<Flow>& flow, int left, int row, int steps)
      : x(hn::ShiftLeft<16>(iota(Words(), left))), y(hn::Set(Words(), row << 16)) {
    const int count = std::min(static_cast<int>(hn::Lanes(Floats())), flow.width - left);
    const float* flows = &flow.row(row)[left].x;
    HWY_ALIGN float tail[2 * hn::MaxLanes(Floats())] = {};
    if (count < static_cast<int>(hn::Lanes(Floats()))) {
      std::copy_n(flows, 2 * count, tail);
      flows = tail;
    }
    hn::Vec<Floats> flow_x;
    hn::Vec<Floats> flow_y;
    hn::LoadInterleaved2(Floats(), flows, flow_x, flow_y);
    dx = motion(flow_x, steps);
    dy = motion(flow_y, steps);
  }

  /// Samples of `next` at the positions reached in `left` steps.
  Vector ahead(const Sampler& next, int left) const {
    const auto steps = hn::Set(Words(), left);
    return next.at(x + steps * dx, y + steps * dy);
  }

 private:
  static Vector motion(hn::Vec<Floats> flow, int steps) {
    const auto limit = hn::Set(Floats(), static_cast<float>(max_side));
    const auto number = hn::IfThenElseZero(hn::Eq(flow, flow), flow);
    const auto clamped = hn::Min(hn::Max(number, hn::Neg(limit)), limit);
    return hn::NearestInt(clamped * hn::Set(Floats(), 65536.0F / static_cast<float>(steps)));
  }
};

/// Blends two samples at step j, in 1/2^20 of a grey level.
Vector blend(Vector earlier, Vector later, int j, int steps) {
  const int weight = blend_weight(j, steps);
  return earlier * hn::Set(Words(), 256 - weight) + later * hn::Set(Words(), weight);
}

/// Number of steps sampled before their differences are thresholded.
constexpr int steps_at_once = 16;

/// First step to evaluate, by tile of a row: 1 or, if nothing can fire before the last step,
/// steps - 1, or `steps` if the frame of step steps - 1 equals the last frame there.
using FirstSteps = std::array<int, max_side / tile_width>;

/// Pairs each pixel of rows [first, last) with the one below it; pixels of the bottom row with
/// themselves.
void pair_rows(const ImageView<std::uint8_t>& frame, int first, int last,
               Image<std::uint16_t>& pairs) {
  const hn::CappedTag<std::uint16_t, 32> words;
  const hn::Rebind<std::uint8_t, decltype(words)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(words));
  for (int y = first; y < last; ++y) {
    const std::uint8_t* here = frame.row(y);
    const std::uint8_t* below = frame.row(std::min(y + 1, frame.height - 1));
    std::uint16_t* out = pairs.row(y);
    for (int x = 0; x < frame.width; x += lanes) {
      const auto low = hn::PromoteTo(words, hn::LoadU(bytes, here + x));
      const auto high = hn::PromoteTo(words, hn::LoadU(bytes, below + x));
      hn::StoreU(hn::Or(low, hn::ShiftLeft<8>(high)), words, out + x);
    }
  }
}

/// Columns measured at once; vectors are capped at this width.
constexpr int columns_at_once = 16;

/// Largest |a - b| over the added rows, per column.
class LargestDifference {
 public:
  void add(const std::uint8_t* a, const std::uint8_t* b) {
    const hn::CappedTag<std::uint8_t, columns_at_once> bytes;
    for (int x = 0; x < columns_at_once; x += static_cast<int>(hn::Lanes(bytes))) {
      const auto p = hn::LoadU(bytes, a + x);
      const auto q = hn::LoadU(bytes, b + x);
      const auto difference = hn::Or(hn::SaturatedSub(p, q), hn::SaturatedSub(q, p));
      hn::Store(hn::Max(hn::Load(bytes, columns_ + x), difference), bytes, columns_ + x);
    }
  }
  std::uint8_t of_cell(int cell) const {
    const auto* c = columns_ + std::ptrdiff_t{4} * cell;
    return std::max(std::max(c[0], c[1]), std::max(c[2], c[3]));
  }

 private:
  HWY_ALIGN std::uint8_t columns_[columns_at_once] = {};
};

/// Measures the row of 4x4 cells that starts at image row `top`. Reads past the right border, which
/// can only increase the bound.
void measure_row(const ImageView<std::uint8_t>& image, int top, std::uint8_t* x_out,
                 std::uint8_t* y_out) {
  const int bottom = std::min(top + 4, image.height);
  for (int left = 0; left < image.width; left += columns_at_once) {
    LargestDifference x;
    LargestDifference y;
    for (int row = top; row < bottom; ++row) {
      const std::uint8_t* here = image.row(row) + left;
      const std::uint8_t* below = image.row(std::min(row + 1, image.height - 1)) + left;
      x.add(here, here + 1);
      y.add(here, below);
    }
    for (int cell = 0; cell < 4; ++cell) {
      x_out[left / 4 + cell] = x.of_cell(cell);
      y_out[left / 4 + cell] = y.of_cell(cell);
    }
  }
}

template <Interpolation interpolation, class LastSampler>
void fire_row(const InterpolatedInterval<std::uint8_t>& interval, const LastSampler& last, int y,
              int band, const FirstSteps& first_steps, StepBuckets& events) {
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(words));
  const int width = interval.flow.width;
  const int steps = interval.steps.count();
  const Sampler now(interval.warp.now);
  const std::uint8_t* last_row = interval.warp.last.row(y);
  const std::uint8_t* now_row = interval.warp.now.row(y);
  const auto positive = hn::Set(words, interval.thresholds.positive);
  const auto negative = hn::Set(words, interval.thresholds.negative);

  for (int x = 0; x < width; x += lanes) {
    const auto within = hn::FirstN(words, static_cast<std::size_t>(std::min(lanes, width - x)));
    const auto fire = [&](Vector before, Vector after, int j) {
      const auto difference = after - before;
      const auto on = difference > positive;
      const auto fired = hn::And(hn::Or(on, hn::Neg(difference) > negative), within);
      if (hn::AllFalse(words, fired)) return;
      events.pixels(j, band).add(x, y, bits_of(words, fired), bits_of(words, on));
    };

    auto before = hn::PromoteTo(words, hn::LoadU(Bytes(), last_row + x));
    const auto end = hn::PromoteTo(words, hn::LoadU(Bytes(), now_row + x));
    const int first = first_steps[x / tile_width];
    if (first == steps) {
      fire(before, end, steps);
      continue;
    }
    const MovingPixels pixels(interval.flow, x, y, steps);
    auto from_x = pixels.x - pixels.dx * hn::Set(words, first - 1);
    auto from_y = pixels.y - pixels.dy * hn::Set(words, first - 1);
    const auto value_at = [&](int j) {
      from_x = from_x - pixels.dx;
      from_y = from_y - pixels.dy;
      const auto earlier = last.at(from_x, from_y);
      if constexpr (interpolation == Interpolation::forward) {
        return hn::ShiftRight<12>(earlier + hn::Set(words, 2048));
      } else {
        const auto sum = blend(earlier, pixels.ahead(now, steps - j), j, steps);
        return hn::ShiftRight<20>(sum + hn::Set(words, 1 << 19));
      }
    };
    if (first > 1) {
      before = value_at(first);
    } else {
      // Whether pixels fire is hard to predict: samples are taken ahead, so that none waits for the
      // branch.
      HWY_ALIGN std::int32_t values[steps_at_once * hn::MaxLanes(words)];
      for (int begin = 1; begin < steps; begin += steps_at_once) {
        const int count = std::min(steps_at_once, steps - begin);
        for (int k = 0; k < count; ++k)
          hn::Store(value_at(begin + k), words, values + std::ptrdiff_t{k} * lanes);
        for (int k = 0; k < count; ++k) {
          const auto value = hn::Load(words, values + std::ptrdiff_t{k} * lanes);
          fire(before, value, begin + k);
          before = value;
        }
      }
    }
    fire(before, end, steps);
  }
}

/// First step of forward interpolation to evaluate in a tile, see FirstSteps.
int first_step(const InterpolatedInterval<std::uint8_t>& interval,
               const GradientBound& gradient_bound, const Box& tile) {
  const int steps = interval.steps.count();
  const auto range = flow_range(interval.flow, tile);
  const auto motion = [steps](float flow) { return std::int64_t{motion_per_step(flow, steps)}; };
  std::int64_t dx = std::max(motion(range.x.max), -motion(range.x.min));
  std::int64_t dy = std::max(motion(range.y.max), -motion(range.y.min));
  // Positions are rounded to 1/64 of a pixel: a pixel that moves by less than half of that samples
  // itself.
  if (std::max(dx, dy) * (steps - 1) < 512) return steps;
  // Margin for rounding.
  dx += 1024;
  dy += 1024;
  // For long flows, finding the bound costs more than it saves.
  constexpr int far = 64;
  const auto reach = [&](float flow) {
    return static_cast<int>(((motion(flow) + 1024) * steps >> 16) + 1);
  };
  const Box reached{tile.left - reach(range.x.max), tile.top - reach(range.y.max),
                    tile.right + reach(-range.x.min), tile.bottom + reach(-range.y.min)};
  if (reached.width() > tile_width + 2 * far || reached.height() > tile_height + 2 * far) return 1;
  const auto bound = gradient_bound.within(reached);
  const std::int64_t threshold =
      std::min(interval.thresholds.positive, interval.thresholds.negative);
  return dx * bound.x + dy * bound.y <= threshold << 16 ? std::max(1, steps - 1) : 1;
}

void fire_band_forward(const InterpolatedInterval<std::uint8_t>& interval,
                       const ImageView<std::uint16_t>& last_pairs,
                       const GradientBound& gradient_bound, int band, StepBuckets& events) {
  const PairSampler last(last_pairs);
  const BandRows rows(band, interval.flow.height);
  const int width = interval.flow.width;
  FirstSteps first_steps;
  for (int top = rows.first; top < rows.last; top += tile_height) {
    const int bottom = std::min(top + tile_height, rows.last);
    for (int left = 0; left < width; left += tile_width)
      first_steps[left / tile_width] = first_step(
          interval, gradient_bound, {left, top, std::min(left + tile_width, width), bottom});
    for (int y = top; y < bottom; ++y)
      fire_row<Interpolation::forward>(interval, last, y, band, first_steps, events);
  }
}

void fire_band_blend(const InterpolatedInterval<std::uint8_t>& interval, int band,
                     StepBuckets& events) {
  const Sampler last(interval.warp.last);
  const BandRows rows(band, interval.flow.height);
  FirstSteps first_steps;
  first_steps.fill(1);
  for (int y = rows.first; y < rows.last; ++y)
    fire_row<Interpolation::blend>(interval, last, y, band, first_steps, events);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(measure_row);
HWY_EXPORT(pair_rows);
HWY_EXPORT(fire_band_forward);
HWY_EXPORT(fire_band_blend);

namespace {

/// Fills a row of large cells, each the maximum of its 4x4 small cells.
void gather_row(const Image<std::uint8_t>& small, int row, Image<std::uint8_t>& large) {
  for (int column = 0; column < large.width(); ++column) {
    std::uint8_t largest = 0;
    for (int y = 4 * row; y < 4 * row + 4; ++y)
      for (int x = 4 * column; x < 4 * column + 4; ++x) largest = std::max(largest, small.at(x, y));
    large.at(column, row) = largest;
  }
}

/// Empties the pixels of each step, in a band of rows.
template <class Pixel>
void begin_steps(const InterpolatedInterval<Pixel>& interval, int band, StepBuckets& events) {
  for (int j = 1; j <= interval.steps.count(); ++j)
    events.pixels(j, band).begin(interval.steps.microseconds(j));
}

template <Interpolation interpolation>
void fire_row_16(const InterpolatedInterval<std::uint16_t>& interval, int y, int band,
                 StepBuckets& events) {
  const int steps = interval.steps.count();
  for (int x = 0; x < interval.flow.width; ++x) {
    const Flow& flow = interval.flow.row(y)[x];
    const Motion dx = motion_per_step(flow.x, steps);
    const Motion dy = motion_per_step(flow.y, steps);
    int before = interval.warp.last.row(y)[x];
    for (int j = 1; j <= steps; ++j) {
      const int value = j < steps ? interval.warp.template at<interpolation>(x, y, dx, dy, j)
                                  : interval.warp.now.row(y)[x];
      const int difference = value - before;
      if (difference > interval.thresholds.positive || -difference > interval.thresholds.negative)
        events.pixels(j, band).add(x, y, 1, difference > 0 ? 1 : 0);
      before = value;
    }
  }
}

}  // namespace

void GradientBound::Cells::shape(int cell_side, int columns, int rows) {
  side = cell_side;
  if (x.width() == columns && x.height() == rows) return;
  x = Image<std::uint8_t>(columns, rows);
  y = Image<std::uint8_t>(columns, rows);
}

void GradientBound::measure(const ImageView<std::uint8_t>& image, ThreadPool& threads) {
  const int columns = (image.width + 15) / 16;
  const int rows = (image.height + 15) / 16;
  far_.shape(16, columns, rows);
  near_.shape(4, 4 * columns, 4 * rows);
  threads.for_each(rows, [&](int row, int) {
    for (int y = 4 * row; y < 4 * row + 4 && 4 * y < image.height; ++y)
      HWY_DYNAMIC_DISPATCH(measure_row)(image, 4 * y, near_.x.row(y), near_.y.row(y));
    gather_row(near_.x, row, far_.x);
    gather_row(near_.y, row, far_.y);
  });
}

GradientBound::Bound GradientBound::within(const Box& box) const {
  constexpr int near = 40;
  return box.width() <= near && box.height() <= near ? near_.within(box) : far_.within(box);
}

GradientBound::Bound GradientBound::Cells::within(const Box& box) const {
  const int left = std::clamp(box.left / side, 0, x.width() - 1);
  const int right = std::clamp((box.right - 1) / side, 0, x.width() - 1);
  const int top = std::clamp(box.top / side, 0, x.height() - 1);
  const int bottom = std::clamp((box.bottom - 1) / side, 0, x.height() - 1);
  std::uint8_t max_x = 0;
  std::uint8_t max_y = 0;
  for (int row = top; row <= bottom; ++row) {
    const auto* x_row = x.row(row);
    const auto* y_row = y.row(row);
    for (int column = left; column <= right; ++column) {
      max_x = std::max(max_x, x_row[column]);
      max_y = std::max(max_y, y_row[column]);
    }
  }
  return {max_x, max_y};
}

void InterpolationKernel::fire(const InterpolatedInterval<std::uint8_t>& interval,
                               ThreadPool& threads, StepBuckets& events) {
  const int bands = band_count(interval.flow.height);
  const bool is_forward = interval.interpolation == Interpolation::forward;
  events.reset(interval.steps.count(), bands);
  if (is_forward) {
    gradient_bound_.measure(interval.warp.last, threads);
    if (last_pairs_.width() != interval.flow.width || last_pairs_.height() != interval.flow.height)
      last_pairs_ = Image<std::uint16_t>(interval.flow.width, interval.flow.height);
    threads.for_each(bands, [&](int band, int) {
      const BandRows rows(band, interval.flow.height);
      HWY_DYNAMIC_DISPATCH(pair_rows)(interval.warp.last, rows.first, rows.last, last_pairs_);
    });
  }
  threads.for_each(bands, [&](int band, int) {
    begin_steps(interval, band, events);
    if (is_forward) {
      HWY_DYNAMIC_DISPATCH(fire_band_forward)
      (interval, last_pairs_.view(), gradient_bound_, band, events);
    } else {
      HWY_DYNAMIC_DISPATCH(fire_band_blend)(interval, band, events);
    }
  });
}

void InterpolationKernel::fire(const InterpolatedInterval<std::uint16_t>& interval,
                               ThreadPool& threads, StepBuckets& events) {
  const int bands = band_count(interval.flow.height);
  events.reset(interval.steps.count(), bands);
  threads.for_each(bands, [&](int band, int) {
    begin_steps(interval, band, events);
    const BandRows rows(band, interval.flow.height);
    for (int y = rows.first; y < rows.last; ++y)
      if (interval.interpolation == Interpolation::forward)
        fire_row_16<Interpolation::forward>(interval, y, band, events);
      else
        fire_row_16<Interpolation::blend>(interval, y, band, events);
  });
}

}  // namespace eventcamera
#endif  // HWY_ONCE
