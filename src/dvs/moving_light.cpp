// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/moving_light.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#ifndef EVENTCAMERA_BLENDED_LUMA
#define EVENTCAMERA_BLENDED_LUMA
namespace eventcamera {
namespace {

/// 16-bit luma of two samples of 8-bit frames, in 1/4096 of a grey level; `weight` is that of the
/// later one.
std::uint16_t blended_luma(std::int32_t earlier, std::int32_t later, int weight) {
  const std::int32_t sum = earlier * 256 + (later - earlier) * weight;
  const std::int32_t grey = (sum + (1 << 7)) >> 8;
  return static_cast<std::uint16_t>((grey * 257 + (1 << 11)) >> 12);
}

}  // namespace
}  // namespace eventcamera
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/dvs/moving_light.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Pixels that are sampled together.
constexpr int block = 8;

/// Displacements of a block along one axis, in 1/65536 of a pixel per step, and their range.
struct BlockMotion {
  HWY_ALIGN Motion of[block];
  Motion min;
  Motion max;

  /// Range of positions after k steps, in whole pixels from the block's own.
  int first_pixel(int k) const { return (k * (k < 0 ? max : min) + 512) >> 16; }
  int last_pixel(int k) const { return (k * (k < 0 ? min : max) + 512) >> 16; }
};

/// Motion of `count` pixels; the others move like the first.
struct BlockMotions {
  BlockMotion x;
  BlockMotion y;

  BlockMotions(const Flow* flow, int count, int steps) {
    for (int i = 0; i < block; ++i) {
      const Flow& here = flow[i < count ? i : 0];
      x.of[i] = motion_per_step(here.x, steps);
      y.of[i] = motion_per_step(here.y, steps);
    }
    x.min = *std::min_element(x.of, x.of + block);
    x.max = *std::max_element(x.of, x.of + block);
    y.min = *std::min_element(y.of, y.of + block);
    y.max = *std::max_element(y.of, y.of + block);
  }

  /// Whether Sampler can sample after k steps.
  bool are_alike(int k) const {
    return x.last_pixel(k) - x.first_pixel(k) < block && y.last_pixel(k) - y.first_pixel(k) < block;
  }
};

/// Blends a block of pixels one by one.
void blend_apart(const Warp<std::uint8_t>& warp, int left, int y, const BlockMotions& motions,
                 int j, std::uint16_t* out) {
  const auto place = [&](int i, int k) {
    return std::pair(((left + i) << 16) + k * motions.x.of[i], (y << 16) + k * motions.y.of[i]);
  };
  for (int i = 0; i < block; ++i) {
    const auto [x, last_y] = place(i, -j);
    const auto [next_x, next_y] = place(i, warp.steps - j);
    out[i] = blended_luma(sample(warp.last, x, last_y), sample(warp.now, next_x, next_y),
                          blend_weight(j, warp.steps));
  }
}

#if HWY_TARGET == HWY_SCALAR

void blend_block(const Warp<std::uint8_t>& warp, int left, int y, const BlockMotions& motions,
                 int j, std::uint16_t* out) {
  blend_apart(warp, left, y, motions, j, out);
}

#else

using Bytes = hn::FixedTag<std::uint8_t, std::size_t{2} * block>;
using Shorts = hn::FixedTag<std::int16_t, block>;
using Shades = hn::FixedTag<std::uint16_t, block>;
using Words = hn::FixedTag<std::int32_t, block / 2>;
using HalfShorts = hn::Half<Shorts>;

/// A value of each pixel of a block.
struct BlockWords {
  hn::Vec<Words> low;
  hn::Vec<Words> high;
};

/// Positions after k steps along one axis, in 1/64 of a pixel from motion.first_pixel(k), which is
/// at most `block` pixels away.
HWY_INLINE hn::Vec<Shorts> positions(const BlockMotion& motion, int k) {
  const auto steps = hn::Set(Words(), k);
  const auto half = hn::Set(Words(), 512);
  const auto origin = hn::Set(Words(), motion.first_pixel(k) * 64);
  const auto position = [&](const Motion* of) {
    const auto moved = hn::Mul(hn::Load(Words(), of), steps);
    return hn::DemoteTo(HalfShorts(), hn::Sub(hn::ShiftRight<10>(hn::Add(moved, half)), origin));
  };
  return hn::Combine(Shorts(), position(motion.of + block / 2), position(motion.of));
}

/// Bilinear samples, the same as those of sample() in warp.hpp, of blocks whose pixels move alike:
/// all of them are in the same few 16 bytes of a few rows.
class Sampler {
 public:
  explicit Sampler(const ImageView<std::uint8_t>& picture) : picture_(picture) {}

  /// Samples of the block at (left, y) after k steps, in 1/4096 of a grey level.
  HWY_INLINE BlockWords at(int left, int y, const BlockMotions& motions, int k) const {
    const Shorts shorts;
    const auto zero = hn::Zero(shorts);
    const auto fraction = hn::Set(shorts, 63);
    // Vectors are relative to the pixel (first_x, first_y).
    const int to_x = left + motions.x.first_pixel(k);
    const int to_y = y + motions.y.first_pixel(k);
    const int first_x = std::clamp(to_x, 0, picture_.width - 1);
    const int first_y = std::clamp(to_y, 0, picture_.height - 1);
    const auto clamped = [&](hn::Vec<Shorts> position, int offset, int end) {
      const auto moved = hn::Add(
          position, hn::Set(shorts, static_cast<std::int16_t>(std::clamp(offset, -64, 64) * 64)));
      const auto last = hn::Set(shorts, static_cast<std::int16_t>(std::min(end, 64) * 64));
      return hn::Min(hn::Max(moved, zero), last);
    };
    const auto x = clamped(hn::Add(positions(motions.x, k), hn::ShiftLeft<6>(hn::Iota(shorts, 0))),
                           to_x - first_x, picture_.width - 1 - first_x);
    const auto position_y =
        clamped(positions(motions.y, k), to_y - first_y, picture_.height - 1 - first_y);

    // Bytes of the left and right neighbours.
    const auto column = hn::ShiftRight<6>(x);
    const auto places = hn::BitCast(
        Bytes(), hn::Add(hn::Or(column, hn::ShiftLeft<8>(column)), hn::Set(shorts, 256)));
    const auto right = hn::And(x, fraction);
    // In 1/64 of a grey level.
    const auto row_at = [&](int row) {
      const auto* pixels = picture_.row(std::min(first_y + row, picture_.height - 1)) + first_x;
      const auto pairs =
          hn::BitCast(Shades(), hn::TableLookupBytes(hn::LoadU(Bytes(), pixels), places));
      const auto a = hn::BitCast(shorts, hn::And(pairs, hn::Set(Shades(), 255)));
      const auto b = hn::BitCast(shorts, hn::ShiftRight<8>(pairs));
      return hn::Add(hn::ShiftLeft<6>(a), hn::Mul(hn::Sub(b, a), right));
    };
    const auto row = hn::ShiftRight<6>(position_y);
    auto upper = row_at(0);
    auto lower = row_at(1);
    auto next = lower;
    const int rows = motions.y.last_pixel(k) - motions.y.first_pixel(k);
    for (int i = 1; i <= rows; ++i) {
      const auto is_here = hn::Eq(row, hn::Set(shorts, static_cast<std::int16_t>(i)));
      const auto below = row_at(i + 1);
      upper = hn::IfThenElse(is_here, next, upper);
      lower = hn::IfThenElse(is_here, below, lower);
      next = below;
    }
    const auto down = hn::And(position_y, fraction);
    const auto rise = hn::Sub(lower, upper);
    const auto low_bits = hn::Mul(rise, down);
    const auto high_bits = hn::MulHigh(rise, down);
    const auto from_upper = [&](hn::Vec<HalfShorts> half, hn::Vec<Shorts> product) {
      return hn::Add(hn::ShiftLeft<6>(hn::PromoteTo(Words(), half)), hn::BitCast(Words(), product));
    };
    return {from_upper(hn::LowerHalf(upper), hn::InterleaveLower(shorts, low_bits, high_bits)),
            from_upper(hn::UpperHalf(HalfShorts(), upper),
                       hn::InterleaveUpper(shorts, low_bits, high_bits))};
  }

 private:
  const ImageView<std::uint8_t>& picture_;
};

/// Vector version of blended_luma().
HWY_INLINE hn::Vec<Words> blended(hn::Vec<Words> earlier, hn::Vec<Words> later,
                                  hn::Vec<Words> weight) {
  const auto sum = hn::Add(hn::ShiftLeft<8>(earlier), hn::Mul(hn::Sub(later, earlier), weight));
  const auto grey = hn::ShiftRight<8>(hn::Add(sum, hn::Set(Words(), 1 << 7)));
  return hn::ShiftRight<12>(
      hn::Add(hn::Add(hn::ShiftLeft<8>(grey), grey), hn::Set(Words(), 1 << 11)));
}

/// Blends a block whose pixels move alike.
void blend_block(const Warp<std::uint8_t>& warp, int left, int y, const BlockMotions& motions,
                 int j, std::uint16_t* out) {
  const hn::Half<Shades> half;
  const auto weight = hn::Set(Words(), blend_weight(j, warp.steps));
  const auto earlier = Sampler(warp.last).at(left, y, motions, -j);
  const auto later = Sampler(warp.now).at(left, y, motions, warp.steps - j);
  hn::StoreU(hn::DemoteTo(half, blended(earlier.low, later.low, weight)), half, out);
  hn::StoreU(hn::DemoteTo(half, blended(earlier.high, later.high, weight)), half, out + block / 2);
}

#endif

void move_light_8(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, const Run& run,
                  std::uint16_t* out, std::ptrdiff_t stride) {
  for (int left = run.first; left < run.last; left += block, out += block) {
    const BlockMotions motions(flow.row(run.y) + left, run.last - left, warp.steps);
    std::uint16_t* row = out;
    for (int j = 1; j < warp.steps; ++j, row += stride) {
      if (motions.are_alike(-j) && motions.are_alike(warp.steps - j))
        blend_block(warp, left, run.y, motions, j, row);
      else
        blend_apart(warp, left, run.y, motions, j, row);
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(move_light_8);

void move_light(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride) {
  HWY_DYNAMIC_DISPATCH(move_light_8)(warp, flow, run, out, stride);
}

void move_light(const Warp<std::uint16_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride) {
  for (int x = run.first; x < run.last; ++x, ++out) {
    const Flow& here = flow.row(run.y)[x];
    const Motion dx = motion_per_step(here.x, warp.steps);
    const Motion dy = motion_per_step(here.y, warp.steps);
    for (int j = 1; j < warp.steps; ++j)
      out[(j - 1) * stride] = warp.at<Interpolation::blend>(x, run.y, dx, dy, j);
  }
}

void widen(const std::uint8_t* luma, int count, std::uint16_t* out) {
  for (int x = 0; x < count; ++x) out[x] = static_cast<std::uint16_t>(luma[x] * 257);
}

void widen(const std::uint16_t* luma, int count, std::uint16_t* out) {
  std::copy_n(luma, count, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
