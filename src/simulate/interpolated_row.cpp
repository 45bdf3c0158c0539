// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/interpolated_row.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/simulate/interpolated_row.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "src/simulate/sampler-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

void interpolate_8(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, int y, int j,
                   std::uint16_t* out) {
  const Words words;
  const hn::Rebind<std::uint16_t, Words> shades;
  const int lanes = static_cast<int>(hn::Lanes(words));
  const int width = flow.width;
  const int left = warp.steps - j;
  const float scale = 65536.0F / static_cast<float>(warp.steps);
  const int weight = blend_weight(j, warp.steps);
  const Sampler last(warp.last);
  const Sampler now(warp.now);
  const auto py = hn::Set(words, y << 16);
  const float* flows = &flow.row(y)->x;

  for (int x = 0; x < width; x += lanes) {
    const int count = std::min(lanes, width - x);
    HWY_ALIGN float tail[2 * hn::MaxLanes(Floats())] = {};
    const float* here = flows + static_cast<std::ptrdiff_t>(2) * x;
    if (count < lanes) {
      std::copy_n(here, 2 * count, tail);
      here = tail;
    }
    hn::Vec<Floats> flow_x;
    hn::Vec<Floats> flow_y;
    hn::LoadInterleaved2(Floats(), here, flow_x, flow_y);
    const auto dx = motions(flow_x, scale);
    const auto dy = motions(flow_y, scale);
    const auto px = hn::ShiftLeft<16>(hn::Iota(words, x));
    const auto done = hn::Set(words, j);
    const auto to_do = hn::Set(words, left);
    const auto earlier = last.at(hn::Sub(px, hn::Mul(done, dx)), hn::Sub(py, hn::Mul(done, dy)));
    const auto later = now.at(hn::Add(px, hn::Mul(to_do, dx)), hn::Add(py, hn::Mul(to_do, dy)));
    const auto blended = hn::Add(hn::Mul(earlier, hn::Set(words, 256 - weight)),
                                 hn::Mul(later, hn::Set(words, weight)));
    // From 1/2^20 of a grey level to 1/257.
    const auto grey = hn::ShiftRight<8>(hn::Add(blended, hn::Set(words, 1 << 7)));
    const auto value =
        hn::ShiftRight<12>(hn::Add(hn::Mul(grey, hn::Set(words, 257)), hn::Set(words, 1 << 11)));
    const auto shade = hn::DemoteTo(shades, value);
    if (count == lanes) {
      hn::StoreU(shade, shades, out + x);
    } else {
      HWY_ALIGN std::uint16_t rest[max_sampled_lanes];
      hn::Store(shade, shades, rest);
      std::copy_n(rest, count, out + x);
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(interpolate_8);

void interpolate_row(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, int y, int j,
                     std::uint16_t* out) {
  HWY_DYNAMIC_DISPATCH(interpolate_8)(warp, flow, y, j, out);
}

void interpolate_row(const Warp<std::uint16_t>& warp, const ImageView<Flow>& flow, int y, int j,
                     std::uint16_t* out) {
  for (int x = 0; x < flow.width; ++x) {
    const Flow& here = flow.row(y)[x];
    out[x] = warp.at<Interpolation::blend>(x, y, motion_per_step(here.x, warp.steps),
                                           motion_per_step(here.y, warp.steps), j);
  }
}

void widen_row(const std::uint8_t* luma, int width, std::uint16_t* out) {
  for (int x = 0; x < width; ++x) out[x] = static_cast<std::uint16_t>(luma[x] * 257);
}

void widen_row(const std::uint16_t* luma, int width, std::uint16_t* out) {
  std::copy_n(luma, width, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
