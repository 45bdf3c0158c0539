// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/path.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/simulate/path.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "src/core/thread_pool.hpp"
#include "src/simulate/fired_lanes-inl.hpp"
#include "src/simulate/sampler-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Pixels that are skipped together or not at all. No vector is wider.
constexpr int tile_width = 16;
static_assert(tile_width == max_sampled_lanes);
constexpr int tile_height = 4;
static_assert(rows_per_band % tile_height == 0);

/// So many steps are sampled before what fires in them is looked for.
constexpr int steps_at_once = 16;

/// For each tile of a row of tiles the step at which to begin, where nothing can fire before the
/// last one: at the last but one, or at the last where that shows the last frame itself. Else 1.
using FirstSteps = std::array<int, max_side / tile_width>;

/// Sets each pixel of some rows beside the one below it, the lowest beside itself.
void pair_rows(const ImageView<std::uint8_t>& picture, int first, int last,
               Image<std::uint16_t>& pairs) {
  const hn::CappedTag<std::uint16_t, 32> words;
  const hn::Rebind<std::uint8_t, decltype(words)> bytes;
  const int lanes = static_cast<int>(hn::Lanes(words));
  for (int y = first; y < last; ++y) {
    const std::uint8_t* here = picture.row(y);
    const std::uint8_t* below = picture.row(std::min(y + 1, picture.height - 1));
    std::uint16_t* out = pairs.row(y);
    for (int x = 0; x < picture.width; x += lanes) {
      const auto low = hn::PromoteTo(words, hn::LoadU(bytes, here + x));
      const auto high = hn::PromoteTo(words, hn::LoadU(bytes, below + x));
      hn::StoreU(hn::Or(low, hn::ShiftLeft<8>(high)), words, out + x);
    }
  }
}

template <Interpolation interpolation, class LastSampler>
void fire_row(const Path<std::uint8_t>& path, const LastSampler& last, int y, int band,
              const FirstSteps& first_steps, EventBuckets& events) {
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(words));
  const int width = path.flow.width;
  const int steps = path.steps.count();
  const float scale = 65536.0F / static_cast<float>(steps);
  const Sampler now(path.warp.now);
  const std::uint8_t* last_row = path.warp.last.row(y);
  const std::uint8_t* now_row = path.warp.now.row(y);
  const auto positive = hn::Set(words, path.thresholds.positive);
  const auto negative = hn::Set(words, path.thresholds.negative);
  const auto py = hn::Set(words, y << 16);

  for (int x = 0; x < width; x += lanes) {
    const int count = std::min(lanes, width - x);
    const auto within = hn::FirstN(words, static_cast<std::size_t>(count));
    const auto off = off_events(x, y);
    const auto fire = [&](Vector before, Vector after, int j) {
      const auto difference = hn::Sub(after, before);
      const auto on = hn::Gt(difference, positive);
      const auto fired = hn::And(hn::Or(on, hn::Gt(hn::Neg(difference), negative)), within);
      if (hn::AllFalse(words, fired)) return;
      const FiredLanes tag;
      Event here[hn::MaxLanes(tag)];
      store_fired(off, hn::RebindMask(tag, fired), hn::RebindMask(tag, on),
                  path.steps.microseconds(j), here);
      auto& out = events.bucket(j, band);
      out.insert(out.end(), here, here + hn::CountTrue(words, fired));
    };

    auto before = hn::PromoteTo(words, hn::LoadU(Bytes(), last_row + x));
    const auto end = hn::PromoteTo(words, hn::LoadU(Bytes(), now_row + x));
    const int first = first_steps[static_cast<std::size_t>(x / tile_width)];
    if (first == steps) {
      fire(before, end, steps);
      continue;
    }
    HWY_ALIGN float flows[2 * hn::MaxLanes(Floats())] = {};
    std::copy_n(&path.flow.row(y)[x].x, 2 * count, flows);
    hn::Vec<Floats> flow_x;
    hn::Vec<Floats> flow_y;
    hn::LoadInterleaved2(Floats(), flows, flow_x, flow_y);
    const auto dx = motions(flow_x, scale);
    const auto dy = motions(flow_y, scale);
    const auto px = hn::ShiftLeft<16>(hn::Iota(words, x));

    auto from_x = hn::Sub(px, hn::Mul(dx, hn::Set(words, first - 1)));
    auto from_y = hn::Sub(py, hn::Mul(dy, hn::Set(words, first - 1)));
    const auto value_at = [&](int j) {
      from_x = hn::Sub(from_x, dx);
      from_y = hn::Sub(from_y, dy);
      const auto value = last.at(from_x, from_y);
      if constexpr (interpolation == Interpolation::forward) {
        return hn::ShiftRight<12>(hn::Add(value, hn::Set(words, 2048)));
      } else {
        const auto left = hn::Set(words, steps - j);
        const auto later = now.at(hn::Add(px, hn::Mul(left, dx)), hn::Add(py, hn::Mul(left, dy)));
        const int weight = blend_weight(j, steps);
        const auto sum = hn::Add(hn::Mul(value, hn::Set(words, 256 - weight)),
                                 hn::Mul(later, hn::Set(words, weight)));
        return hn::ShiftRight<20>(hn::Add(sum, hn::Set(words, 1 << 19)));
      }
    };
    if (first > 1) {
      before = value_at(first);
    } else {
      // Many samples before what fires, which is hard to foretell: none waits for that.
      HWY_ALIGN std::int32_t values[steps_at_once * hn::MaxLanes(words)];
      for (int begin = 1; begin < steps; begin += steps_at_once) {
        const int count_here = std::min(steps_at_once, steps - begin);
        for (int k = 0; k < count_here; ++k)
          hn::Store(value_at(begin + k), words, values + std::ptrdiff_t{k} * lanes);
        for (int k = 0; k < count_here; ++k) {
          const auto value = hn::Load(words, values + std::ptrdiff_t{k} * lanes);
          fire(before, value, begin + k);
          before = value;
        }
      }
    }
    fire(before, end, steps);
  }
}

/// How far the pixels of a tile move, at most and at least, pixels.
struct FlowRange {
  float least[2];  ///< x, y
  float most[2];
};

FlowRange flow_range(const ImageView<Flow>& flow, const Box& tile) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const int count = 2 * tile.width();
  auto least = hn::Zero(floats);
  auto most = hn::Zero(floats);
  FlowRange range{};
  for (int y = tile.top; y < tile.bottom; ++y) {
    const float* row = &flow.row(y)[tile.left].x;
    int i = 0;
    for (; i + lanes <= count; i += lanes) {
      const auto here = hn::LoadU(floats, row + i);
      // What is no number does not move.
      const auto number = hn::IfThenElseZero(hn::Eq(here, here), here);
      least = hn::Min(least, number);
      most = hn::Max(most, number);
    }
    for (; i < count; ++i) {
      if (row[i] < range.least[i % 2]) range.least[i % 2] = row[i];
      if (row[i] > range.most[i % 2]) range.most[i % 2] = row[i];
    }
  }
  HWY_ALIGN float lane[hn::MaxLanes(Floats())];
  hn::Store(least, floats, lane);
  for (int i = 0; i < lanes; ++i) range.least[i % 2] = std::min(range.least[i % 2], lane[i]);
  hn::Store(most, floats, lane);
  for (int i = 0; i < lanes; ++i) range.most[i % 2] = std::max(range.most[i % 2], lane[i]);
  return range;
}

/// The first step of a forward path at which a tile must be looked at.
int first_step(const Path<std::uint8_t>& path, const GradientBound& gradient_bound,
               const Box& tile) {
  const int steps = path.steps.count();
  const auto range = flow_range(path.flow, tile);
  const auto motion = [steps](float flow) { return std::int64_t{motion_per_step(flow, steps)}; };
  std::int64_t dx = std::max(motion(range.most[0]), -motion(range.least[0]));
  std::int64_t dy = std::max(motion(range.most[1]), -motion(range.least[1]));
  // Places are rounded to 1/64 of a pixel: nearer than half of that to where it began, a sample is
  // the pixel itself.
  if (std::max(dx, dy) * (steps - 1) < 512) return steps;
  // And a step may be that much longer.
  dx += 1024;
  dy += 1024;
  // Where things come from afar, looking for the steepest place on the way costs more than it
  // saves.
  constexpr int far = 64;
  const auto reach = [&](float flow) {
    return static_cast<int>(((motion(flow) + 1024) * steps >> 16) + 1);
  };
  const Box reached{tile.left - reach(range.most[0]), tile.top - reach(range.most[1]),
                    tile.right + reach(-range.least[0]), tile.bottom + reach(-range.least[1])};
  if (reached.width() > tile_width + 2 * far || reached.height() > tile_height + 2 * far) return 1;
  const auto bound = gradient_bound.within(reached);
  const std::int64_t threshold = std::min(path.thresholds.positive, path.thresholds.negative);
  return dx * bound.x + dy * bound.y <= threshold << 16 ? std::max(1, steps - 1) : 1;
}

void fire_band_forward(const Path<std::uint8_t>& path, const ImageView<std::uint16_t>& last_pairs,
                       const GradientBound& gradient_bound, int band, EventBuckets& events) {
  const PairSampler last(last_pairs);
  const BandRows rows(band, path.flow.height);
  const int width = path.flow.width;
  FirstSteps first_steps;
  for (int top = rows.first; top < rows.last; top += tile_height) {
    const int bottom = std::min(top + tile_height, rows.last);
    for (int left = 0; left < width; left += tile_width)
      first_steps[static_cast<std::size_t>(left / tile_width)] =
          first_step(path, gradient_bound, {left, top, std::min(left + tile_width, width), bottom});
    for (int y = top; y < bottom; ++y)
      fire_row<Interpolation::forward>(path, last, y, band, first_steps, events);
  }
}

void fire_band_blend(const Path<std::uint8_t>& path, int band, EventBuckets& events) {
  const Sampler last(path.warp.last);
  const BandRows rows(band, path.flow.height);
  FirstSteps first_steps;
  first_steps.fill(1);
  for (int y = rows.first; y < rows.last; ++y)
    fire_row<Interpolation::blend>(path, last, y, band, first_steps, events);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {
namespace {

template <Interpolation interpolation>
void fire_row_16(const Path<std::uint16_t>& path, int y, int band, EventBuckets& events) {
  const int steps = path.steps.count();
  for (int x = 0; x < path.flow.width; ++x) {
    const Flow& flow = path.flow.row(y)[x];
    const Motion dx = motion_per_step(flow.x, steps);
    const Motion dy = motion_per_step(flow.y, steps);
    int before = path.warp.last.row(y)[x];
    for (int j = 1; j <= steps; ++j) {
      const int value = j < steps ? path.warp.template at<interpolation>(x, y, dx, dy, j)
                                  : path.warp.now.row(y)[x];
      const int difference = value - before;
      if (difference > path.thresholds.positive || -difference > path.thresholds.negative)
        events.bucket(j, band).push_back(Event::at(x, y, path.steps.microseconds(j),
                                                   difference > 0 ? Polarity::on : Polarity::off));
      before = value;
    }
  }
}

template <Interpolation interpolation>
void fire_band_16(const Path<std::uint16_t>& path, int band, EventBuckets& events) {
  const BandRows rows(band, path.flow.height);
  for (int y = rows.first; y < rows.last; ++y) fire_row_16<interpolation>(path, y, band, events);
}

HWY_EXPORT(pair_rows);
HWY_EXPORT(fire_band_forward);
HWY_EXPORT(fire_band_blend);

}  // namespace

void PathWalker::fire(const Path<std::uint8_t>& path, ThreadPool& threads, EventBuckets& events) {
  const int bands = band_count(path.flow.height);
  events.reset(path.steps.count(), bands);
  if (path.interpolation == Interpolation::forward) {
    gradient_bound_.measure(path.warp.last, threads);
    if (last_pairs_.width() != path.flow.width || last_pairs_.height() != path.flow.height)
      last_pairs_ = Image<std::uint16_t>(path.flow.width, path.flow.height);
    threads.for_each(bands, [&](int band, int) {
      const BandRows rows(band, path.flow.height);
      HWY_DYNAMIC_DISPATCH(pair_rows)(path.warp.last, rows.first, rows.last, last_pairs_);
    });
    threads.for_each(bands, [&](int band, int) {
      HWY_DYNAMIC_DISPATCH(fire_band_forward)
      (path, last_pairs_.view(), gradient_bound_, band, events);
    });
  } else {
    threads.for_each(bands, [&](int band, int) {
      HWY_DYNAMIC_DISPATCH(fire_band_blend)(path, band, events);
    });
  }
}

void PathWalker::fire(const Path<std::uint16_t>& path, ThreadPool& threads, EventBuckets& events) {
  const int bands = band_count(path.flow.height);
  events.reset(path.steps.count(), bands);
  threads.for_each(bands, [&](int band, int) {
    if (path.interpolation == Interpolation::forward)
      fire_band_16<Interpolation::forward>(path, band, events);
    else
      fire_band_16<Interpolation::blend>(path, band, events);
  });
}

}  // namespace eventcamera
#endif  // HWY_ONCE
