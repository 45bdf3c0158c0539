// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/denoise.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/simulate/denoise.cpp"
#include <hwy/foreach_target.h>
// Must come after HWY_TARGET_INCLUDE.
#include <hwy/highway.h>

#include <algorithm>

#include "src/core/thread_pool.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class Pixel>
void denoise_row(const Pixel* above, const Pixel* here, const Pixel* below, int width, int limit,
                 Pixel* out) {
  using Wide = hwy::MakeSigned<hwy::MakeWide<Pixel>>;  // holds a sum of 16 differences
  const hn::ScalableTag<Wide> wide;
  const hn::Rebind<Pixel, decltype(wide)> pixels;
  const int lanes = static_cast<int>(hn::Lanes(wide));
  const auto max = hn::Set(wide, static_cast<Wide>(limit));
  const auto min = hn::Set(wide, static_cast<Wide>(-limit));
  const auto vectors = [&](int x) {
    const auto load = [&](const Pixel* row, int at) {
      return hn::PromoteTo(wide, hn::LoadU(pixels, row + at));
    };
    const auto centre = load(here, x);
    const auto difference = [&](const Pixel* row, int at) {
      return hn::Min(hn::Max(hn::Sub(load(row, at), centre), min), max);
    };
    const auto corners = hn::Add(hn::Add(difference(above, x - 1), difference(above, x + 1)),
                                 hn::Add(difference(below, x - 1), difference(below, x + 1)));
    const auto sides = hn::Add(hn::Add(difference(above, x), difference(below, x)),
                               hn::Add(difference(here, x - 1), difference(here, x + 1)));
    const auto sum = hn::Add(hn::Add(corners, hn::Add(sides, sides)), hn::Set(wide, 8));
    hn::StoreU(hn::DemoteTo(pixels, hn::Add(centre, hn::ShiftRight<4>(sum))), pixels, out + x);
  };
  const auto one = [&](int x) {
    const int left = std::max(x - 1, 0);
    const int right = std::min(x + 1, width - 1);
    const int centre = here[x];
    const auto difference = [&](const Pixel* row, int at) {
      return std::clamp(row[at] - centre, -limit, limit);
    };
    const int corners = difference(above, left) + difference(above, right) +
                        difference(below, left) + difference(below, right);
    const int sides = difference(above, x) + difference(below, x) + difference(here, left) +
                      difference(here, right);
    out[x] = static_cast<Pixel>(centre + ((corners + 2 * sides + 8) >> 4));
  };

  one(0);
  int x = 1;
  for (; x + lanes < width; x += lanes) vectors(x);
  for (; x < width; ++x) one(x);
}

template <class Pixel>
void denoise_rows(const ImageView<Pixel>& frame, int limit, ThreadPool& threads,
                  Image<Pixel>& out) {
  for_each_row(threads, frame.height, [&](int y) {
    denoise_row(frame.row(std::max(y - 1, 0)), frame.row(y),
                frame.row(std::min(y + 1, frame.height - 1)), frame.width, limit, out.row(y));
  });
}

void denoise_8(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
               Image<std::uint8_t>& out) {
  denoise_rows(frame, limit, threads, out);
}

void denoise_16(const ImageView<std::uint16_t>& frame, int limit, ThreadPool& threads,
                Image<std::uint16_t>& out) {
  denoise_rows(frame, limit, threads, out);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(denoise_8);
HWY_EXPORT(denoise_16);

void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint8_t>& out) {
  HWY_DYNAMIC_DISPATCH(denoise_8)(frame, limit, threads, out);
}

void denoise(const ImageView<std::uint16_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint16_t>& out) {
  HWY_DYNAMIC_DISPATCH(denoise_16)(frame, limit, threads, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
