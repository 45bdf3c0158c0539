// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/moving_light.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

#include "src/core/sensor_size.hpp"
#include "src/flow/flow_range.hpp"

#define HWY_TARGET_INCLUDE "src/dvs/moving_light.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Number of pixels that are sampled together if their samples are close to each other.
constexpr int block = 8;

/// Number of blocks in a vector.
#if HWY_TARGET == HWY_SCALAR || HWY_HAVE_SCALABLE
constexpr int max_blocks = 1;
#else
constexpr int max_blocks = std::min(4, HWY_MAX_BYTES / 16);
#endif
constexpr int max_pixels = max_blocks * block;

using Words4 = hn::CappedTag<std::int32_t, 4>;

/// Positions of pixels along one axis and their displacements per step, in 1/65536 of a pixel.
struct AxisMotion {
  HWY_ALIGN std::int32_t start[max_pixels];  ///< plus half of 1/64 pixel, for rounding
  HWY_ALIGN Motion of[max_pixels];
  HWY_ALIGN std::int32_t block_start[4] = {};
  HWY_ALIGN Motion min[4] = {};  ///< by block
  HWY_ALIGN Motion max[4] = {};

  void find_ranges(int blocks) {
    const Words4 words;
    for (std::ptrdiff_t i = 0; i < blocks; ++i) {
      const Motion* here = of + i * block;
      auto min_motion = hn::Load(words, here);
      auto max_motion = min_motion;
      for (std::size_t k = hn::Lanes(words); k < block; k += hn::Lanes(words)) {
        min_motion = hn::Min(min_motion, hn::Load(words, here + k));
        max_motion = hn::Max(max_motion, hn::Load(words, here + k));
      }
      block_start[i] = start[i * block];
      min[i] = hn::GetLane(hn::MinOfLanes(words, min_motion));
      max[i] = hn::GetLane(hn::MaxOfLanes(words, max_motion));
    }
  }

  /// True if the pixels of each block stay less than a block apart for `steps` steps.
  bool stay_close(int blocks, int steps) const {
    std::int64_t max_difference = 0;
    for (int i = 0; i < blocks; ++i)
      max_difference = std::max(max_difference, std::int64_t{max[i]} - std::int64_t{min[i]});
    return max_difference * steps <= (block - 1) << 16;
  }

  /// True if the pixels of the first block are less than a block apart after k steps.
  bool are_close(int k) const {
    const auto pixel = [&](Motion motion) { return (k * motion + 512) >> 16; };
    return std::abs(pixel(max[0]) - pixel(min[0])) < block;
  }
};

/// Motion of the pixels of some blocks.
struct BlockMotions {
  AxisMotion x;
  AxisMotion y;

  /// Motion of `count` pixels of a row, from `left` on; the others move like the first.
  BlockMotions(const Flow* flow, int left, int row, int count, int blocks, int steps) {
    const hn::CappedTag<float, block> floats;
    const hn::RebindToSigned<decltype(floats)> words;
    HWY_ALIGN Flow flows[max_pixels];
    std::copy_n(flow, count, flows);
    std::fill(flows + count, flows + std::ptrdiff_t{blocks} * block, flow[0]);
    const auto limit = hn::Set(floats, static_cast<float>(max_side));
    const auto scale = hn::Set(floats, 65536.0F / static_cast<float>(steps));
    const auto per_step = [&](hn::Vec<decltype(floats)> motion) {  // motion_per_step()
      const auto clamped = hn::Max(hn::Min(motion, limit), hn::Neg(limit));
      return hn::NearestInt(hn::IfThenElseZero(hn::Eq(motion, motion), clamped * scale));
    };
    const auto first_x = hn::Set(words, (left << 16) + 512);
    const auto first_y = hn::Set(words, (row << 16) + 512);
    for (int i = 0; i < blocks * block; i += static_cast<int>(hn::Lanes(floats))) {
      hn::Vec<decltype(floats)> dx;
      hn::Vec<decltype(floats)> dy;
      hn::LoadInterleaved2(floats, &flows[i].x, dx, dy);
      hn::Store(per_step(dx), words, x.of + i);
      hn::Store(per_step(dy), words, y.of + i);
      hn::Store(first_x + hn::ShiftLeft<16>(iota(words, i)), words, x.start + i);
      hn::Store(first_y, words, y.start + i);
    }
    x.find_ranges(blocks);
    y.find_ranges(blocks);
  }

  bool stay_close(int blocks, int steps) const {
    return x.stay_close(blocks, steps) && y.stay_close(blocks, steps);
  }
  bool are_close(int k) const { return x.are_close(k) && y.are_close(k); }
};

/// 16-bit luma of two samples of 8-bit frames, in 1/4096 of a grey level; `weight` applies to the
/// later one.
std::uint16_t blended_luma(std::int32_t earlier, std::int32_t later, int weight) {
  const std::int32_t sum = earlier * 256 + (later - earlier) * weight;
  const std::int32_t grey = (sum + (1 << 7)) >> 8;
  return static_cast<std::uint16_t>((grey * 257 + (1 << 11)) >> 12);
}

void blend_singly(const Warp<std::uint8_t>& warp, const BlockMotions& motions, int j,
                  std::uint16_t* out) {
  const auto sample_of = [&](const ImageView<std::uint8_t>& frame, int i, int k) {
    return sample(frame, motions.x.start[i] - 512 + k * motions.x.of[i],
                  motions.y.start[i] - 512 + k * motions.y.of[i]);
  };
  for (int i = 0; i < block; ++i)
    out[i] = blended_luma(sample_of(warp.last, i, -j), sample_of(warp.now, i, warp.steps - j),
                          blend_weight(j, warp.steps));
}

#if HWY_TARGET == HWY_SCALAR

template <int blocks>
void blend_blocks(const Warp<std::uint8_t>& warp, const BlockMotions& motions, int j,
                  std::uint16_t* out) {
  blend_singly(warp, motions, j, out);
}

#else

/// Vector version of sample() in warp.hpp, for blocks whose pixels are close together: all samples
/// of a block are in the same 16 bytes of a few rows.
template <int blocks>
class Sampler {
 public:
  using Bytes = hn::FixedTag<std::uint8_t, std::size_t{16} * blocks>;
  using Shorts = hn::Repartition<std::int16_t, Bytes>;
  using Shades = hn::Repartition<std::uint16_t, Bytes>;
  using Words = hn::Repartition<std::int32_t, Bytes>;

  /// Values of the first and the last four pixels of each block.
  struct Values {
    hn::Vec<Words> low;
    hn::Vec<Words> high;
  };

  explicit Sampler(const ImageView<std::uint8_t>& frame) : frame_(frame) {}

  /// Samples after k steps, in 1/4096 of a grey level.
  HWY_INLINE Values at(const BlockMotions& motions, int k) const {
    const Shorts shorts;
    const auto fraction = hn::Set(shorts, 63);
    HWY_ALIGN std::int32_t first_x[4];
    HWY_ALIGN std::int32_t first_y[4];
    const auto left = first_pixels(motions.x, k, frame_.width, first_x);
    const auto top = first_pixels(motions.y, k, frame_.height, first_y);
    const auto x = positions(motions.x, k, frame_.width, first_x);
    const auto y = positions(motions.y, k, frame_.height, first_y);

    // Bytes of the left and right neighbours.
    const auto column = hn::ShiftRight<6>(x);
    const auto places =
        hn::BitCast(Bytes(), hn::Or(column, hn::ShiftLeft<8>(column)) + hn::Set(shorts, 256));
    const auto right = hn::And(x, fraction);
    // In 1/64 of a grey level.
    const auto row_at = [&](int row) HWY_ATTR {
      const auto pairs =
          hn::BitCast(Shades(), hn::TableLookupBytes(pixels_at(left, top, row), places));
      const auto a = hn::BitCast(shorts, hn::And(pairs, hn::Set(Shades(), 255)));
      const auto b = hn::BitCast(shorts, hn::ShiftRight<8>(pairs));
      return hn::ShiftLeft<6>(a) + (b - a) * right;
    };
    const auto row = hn::ShiftRight<6>(y);
    auto upper = row_at(0);
    auto lower = row_at(1);
    auto next = lower;
    for (int i = 0;; ++i) {
      const auto is_below = row > hn::Set(shorts, static_cast<std::int16_t>(i));
      if (hn::AllFalse(shorts, is_below)) break;
      const auto below = row_at(i + 2);
      upper = hn::IfThenElse(is_below, next, upper);
      lower = hn::IfThenElse(is_below, below, lower);
      next = below;
    }
    const auto down = hn::And(y, fraction);
    const auto rise = lower - upper;
    const auto low_bits = rise * down;
    const auto high_bits = hn::MulHigh(rise, down);
    // `wide` is upper in the upper halves of words.
    const auto sum = [](hn::Vec<Shorts> wide, hn::Vec<Shorts> product) HWY_ATTR {
      return hn::ShiftRight<10>(hn::BitCast(Words(), wide)) + hn::BitCast(Words(), product);
    };
    const auto zero = hn::Zero(shorts);
    return {sum(hn::InterleaveLower(shorts, zero, upper),
                hn::InterleaveLower(shorts, low_bits, high_bits)),
            sum(hn::InterleaveUpper(shorts, zero, upper),
                hn::InterleaveUpper(shorts, low_bits, high_bits))};
  }

 private:
  /// First pixel along an axis that each block reads.
  static HWY_INLINE hn::Vec<Words4> first_pixels(const AxisMotion& motion, int k, int size,
                                                 std::int32_t* first) {
    const Words4 words;
    const auto slowest = hn::Load(words, k < 0 ? motion.max : motion.min);
    const auto moved = hn::Load(words, motion.block_start) + slowest * hn::Set(words, k);
    const auto pixels =
        hn::Min(hn::Max(hn::ShiftRight<16>(moved), hn::Zero(words)), hn::Set(words, size - 1));
    hn::Store(pixels, words, first);
    return pixels;
  }

  /// Positions along an axis, in 1/64 of a pixel from the first one of their block.
  static HWY_INLINE hn::Vec<Shorts> positions(const AxisMotion& motion, int k, int size,
                                              const std::int32_t* first) {
    const Words words;
    const hn::Half<Shorts> half;
    const auto end = hn::Set(words, (size - 1) * 64);
    const auto firsts = hn::LoadDup128(words, first);
    const auto part = [&](std::size_t i) HWY_ATTR {
      const auto moved =
          hn::Load(words, motion.start + i) + hn::Load(words, motion.of + i) * hn::Set(words, k);
      const auto position = hn::Min(hn::Max(hn::ShiftRight<10>(moved), hn::Zero(words)), end);
      const auto own = hn::TableLookupBytes(
          firsts, hn::BitCast(words, hn::Load(Bytes(), word_of_block.of + 4 * i)));
      return hn::DemoteTo(half, position - hn::ShiftLeft<6>(own));
    };
    return hn::Combine(Shorts(), part(hn::MaxLanes(words)), part(0));
  }

  /// 16 bytes of each block, `row` rows below its first one.
  HWY_INLINE hn::Vec<Bytes> pixels_at(hn::Vec<Words4> left, hn::Vec<Words4> top, int row) const {
    const Words4 words;
    const auto last = hn::Set(words, frame_.height - 1);
    const auto stride = hn::Set(words, static_cast<std::int32_t>(frame_.stride));
    HWY_ALIGN std::int32_t places[4];
    hn::Store(hn::Min(top + hn::Set(words, row), last) * stride + left, words, places);
    return gather(Bytes(), places);
  }

  /// 16 bytes at each of these places.
  template <class Tag>
  HWY_INLINE hn::Vec<Tag> gather(Tag tag, const std::int32_t* places) const {
    constexpr std::size_t count = hn::MaxLanes(Tag()) / 16;
    if constexpr (count == 1) {
      return hn::LoadU(tag, frame_.row(0) + *places);
    } else {
      const hn::Half<Tag> half;
      return hn::Combine(tag, gather(half, places + count / 2), gather(half, places));
    }
  }

  /// Indices of the bytes of the word of each pixel's block.
  static constexpr auto word_of_block = [] {
    struct alignas(64) Table {
      std::uint8_t of[max_pixels * 4];
    };
    Table table{};
    for (int i = 0; i < max_pixels * 4; ++i)
      table.of[i] = static_cast<std::uint8_t>(i / (4 * block) * 4 + i % 4);
    return table;
  }();

  const ImageView<std::uint8_t>& frame_;
};

/// Vector version of blended_luma().
template <class Words>
HWY_INLINE hn::Vec<Words> blended(Words words, hn::Vec<Words> earlier, hn::Vec<Words> later,
                                  hn::Vec<Words> weight) {
  const auto sum = hn::ShiftLeft<8>(earlier) + (later - earlier) * weight;
  const auto grey = hn::ShiftRight<8>(sum + hn::Set(words, 1 << 7));
  return hn::ShiftRight<12>(hn::ShiftLeft<8>(grey) + grey + hn::Set(words, 1 << 11));
}

/// Blends blocks whose pixels are close together.
template <int blocks>
void blend_blocks(const Warp<std::uint8_t>& warp, const BlockMotions& motions, int j,
                  std::uint16_t* out) {
  using FrameSampler = Sampler<blocks>;
  const typename FrameSampler::Words words;
  const typename FrameSampler::Bytes bytes;
  const auto weight = hn::Set(words, blend_weight(j, warp.steps));
  const auto earlier = FrameSampler(warp.last).at(motions, -j);
  const auto later = FrameSampler(warp.now).at(motions, warp.steps - j);
  const auto low = blended(words, earlier.low, later.low, weight);
  const auto high = blended(words, earlier.high, later.high, weight);
  // The first four pixels of a block are in the lower halves of words, the others in the upper.
  HWY_ALIGN static constexpr std::uint8_t in_order[16] = {0, 1, 4, 5, 8,  9,  12, 13,
                                                          2, 3, 6, 7, 10, 11, 14, 15};
  const auto both = hn::BitCast(bytes, hn::Or(low, hn::ShiftLeft<16>(high)));
  hn::StoreU(hn::BitCast(typename FrameSampler::Shades(),
                         hn::TableLookupBytes(both, hn::LoadDup128(bytes, in_order))),
             typename FrameSampler::Shades(), out);
}

#endif

/// Moves the pixels of some blocks; `count` of them are in the run.
template <int blocks>
void move_blocks(const Warp<std::uint8_t>& warp, const Flow* flow, int left, int y, int count,
                 std::uint16_t* out, std::ptrdiff_t stride) {
  const BlockMotions motions(flow, left, y, count, blocks, warp.steps);
  if (motions.stay_close(blocks, warp.steps - 1)) {
    for (int j = 1; j < warp.steps; ++j, out += stride) blend_blocks<blocks>(warp, motions, j, out);
    return;
  }
  if constexpr (blocks > 1) {
    for (int i = 0; i < count; i += block)
      move_blocks<1>(warp, flow + i, left + i, y, block, out + i, stride);
  } else {
    for (int j = 1; j < warp.steps; ++j, out += stride) {
      if (motions.are_close(-j) && motions.are_close(warp.steps - j))
        blend_blocks<1>(warp, motions, j, out);
      else
        blend_singly(warp, motions, j, out);
    }
  }
}

void move_light_8(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, const Run& run,
                  std::uint16_t* out, std::ptrdiff_t stride) {
  for (int left = run.first; left < run.last;) {
    const Flow* here = flow.row(run.y) + left;
    const int rest = run.last - left;
    const int count = rest >= max_pixels ? max_pixels : std::min(rest, block);
    if (count == max_pixels)
      move_blocks<max_blocks>(warp, here, left, run.y, count, out, stride);
    else
      move_blocks<1>(warp, here, left, run.y, count, out, stride);
    left += count;
    out += count;
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(move_light_8);

namespace {

/// Number of steps of a tile whose pixels move by up to `max_motion` pixels. Luma is linear between
/// steps. Where it bends, the error of event times is proportional to the motion and inversely to
/// the square of the steps: from `fine` pixels on, steps grow with the square root of the motion,
/// which keeps the error constant.
int steps_for(float max_motion, int max_steps) {
  constexpr float fine = 4;
  const float steps = max_motion <= fine ? max_motion : std::sqrt(fine * max_motion);
  return std::clamp(static_cast<int>(std::ceil(steps)), 1, max_steps);
}

}  // namespace

void MotionTiles::measure(const ImageView<Flow>& flow, int max_steps, ThreadPool& threads) {
  const int columns = (flow.width + width - 1) / width;
  const int rows = (flow.height + height - 1) / height;
  if (steps_.width() != columns || steps_.height() != rows)
    steps_ = Image<std::int32_t>(columns, rows);
  threads.for_each(rows, [&](int row, int) {
    for (int column = 0; column < columns; ++column) {
      const Box box{column * width, row * height, std::min((column + 1) * width, flow.width),
                    std::min((row + 1) * height, flow.height)};
      const auto max_motion =
          std::min(flow_range(flow, box).max_length(), static_cast<float>(max_side));
      steps_.at(column, row) = steps_for(max_motion, max_steps);
    }
  });
}

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
