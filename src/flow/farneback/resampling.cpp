// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/farneback/resampling.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/farneback/resampling.cpp"
#include <hwy/foreach_target.h>
// Highway wants to come after that.
#include <hwy/highway.h>

#include <cmath>
#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, Resampling::spare>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Vector = hn::Vec<Floats>;

Vector between(Vector a, Vector b, Vector weight) {
  return hn::Add(a, hn::Mul(weight, hn::Sub(b, a)));
}

void resample_one(const float* row, const Resampling& resampling, float* out) {
  const Floats floats;
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < resampling.size(); x += lanes) {
    const auto first = hn::LoadU(words, resampling.first() + x);
    const auto a = hn::GatherIndex(floats, row, first);
    const auto b = hn::GatherIndex(floats, row + 1, first);
    hn::StoreU(between(a, b, hn::LoadU(floats, resampling.weight() + x)), floats, out + x);
  }
}

void resample_two(const float* upper, const float* lower, float weight, int width,
                  const Resampling& resampling, float factor, float* row, float* out) {
  const Floats floats;
  const Words words;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto down = hn::Set(floats, weight);
  const auto times = hn::Set(floats, factor);
  for (int i = 0; i < 2 * width; i += lanes) {
    const auto a = hn::LoadU(floats, upper + i);
    const auto b = hn::LoadU(floats, lower + i);
    hn::StoreU(hn::Mul(between(a, b, down), times), floats, row + i);
  }
  float* end = row + std::ptrdiff_t{2} * width;
  end[0] = end[-2];
  end[1] = end[-1];
  for (int x = 0; x < resampling.size(); x += lanes) {
    const auto first = hn::ShiftLeft<1>(hn::LoadU(words, resampling.first() + x));
    const auto right = hn::LoadU(floats, resampling.weight() + x);
    const auto at = [&](int i) { return hn::GatherIndex(floats, row + i, first); };
    hn::StoreInterleaved2(between(at(0), at(2), right), between(at(1), at(3), right), floats,
                          out + std::ptrdiff_t{2} * x);
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(resample_one);
HWY_EXPORT(resample_two);

Resampling::Resampling(int from, int to)
    : size_(to), first_(to + spare, 0), weight_(to + spare, 0.0F) {
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double place = (i + 0.5) * ratio - 0.5;
    const int before = static_cast<int>(std::floor(place));
    if (before < 0) continue;
    first_[i] = before < from - 1 ? before : from - 1;
    weight_[i] = before < from - 1 ? static_cast<float>(place - before) : 0.0F;
  }
}

void resample_row(const float* row, const Resampling& resampling, float* out) {
  HWY_DYNAMIC_DISPATCH(resample_one)(row, resampling, out);
}

void resample_pairs(const float* upper, const float* lower, float weight, int width,
                    const Resampling& resampling, float factor, float* between, float* out) {
  HWY_DYNAMIC_DISPATCH(resample_two)
  (upper, lower, weight, width, resampling, factor, between, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
