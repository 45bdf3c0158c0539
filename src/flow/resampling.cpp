// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/resampling.hpp"

#include <algorithm>
#include <cmath>

#include "src/flow/scratch.hpp"

#define HWY_TARGET_INCLUDE "src/flow/resampling.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, row_padding>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Vector = hn::Vec<Floats>;

void resample_floats(const float* row, const Resampling& resampling, float* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  for (int x = 0; x < resampling.size(); x += lanes) {
    const auto first = hn::LoadU(Words(), resampling.first() + x);
    const auto a = hn::GatherIndex(floats, row, first);
    const auto b = hn::GatherIndex(floats, row + 1, first);
    hn::StoreU(lerp(a, b, hn::LoadU(floats, resampling.weight() + x)), floats, out + x);
  }
}

void resample_flows(const Flow* row, const Resampling& resampling, int begin, int end, float factor,
                    Flow* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto times = hn::Set(floats, factor);
  const float* values = &row->x;
  for (int x = begin; x < end; x += lanes) {
    const std::int32_t* first = resampling.first() + x;
    const int left = 2 * first[0];
    const int right = 2 * first[std::min(lanes, end - x) - 1] + 4;
    const auto index = hn::ShiftLeft<1>(hn::LoadU(Words(), first));
    const auto weight = hn::LoadU(floats, resampling.weight() + x);
    const auto blend = [&](const auto& at) {
      hn::StoreInterleaved2(lerp(at(0), at(2), weight) * times, lerp(at(1), at(3), weight) * times,
                            floats, &out[x].x);
    };
    if (right - left <= 2 * lanes) {  // the usual case: the row becomes twice as long
      const auto low = hn::LoadU(floats, values + left);
      const auto high = hn::LoadU(floats, values + left + lanes);
      blend([&](int i) { return Lookup<Floats>(index - hn::Set(Words(), left - i))(low, high); });
    } else {
      blend([&](int i) { return hn::GatherIndex(floats, values + i, index); });
    }
  }
}

void blend_flows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto down = hn::Set(floats, weight);
  for (int i = 0; i < 2 * width; i += lanes)
    hn::StoreU(lerp(hn::LoadU(floats, &upper->x + i), hn::LoadU(floats, &lower->x + i), down),
               floats, &out->x + i);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(resample_floats);
HWY_EXPORT(resample_flows);
HWY_EXPORT(blend_flows);

Resampling::Resampling(int from, int to)
    : size_(to), first_(to + row_padding, 0), weight_(to + row_padding, 0.0F) {
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
  HWY_DYNAMIC_DISPATCH(resample_floats)(row, resampling, out);
}

void resample_row(const Flow* row, const Resampling& resampling, float factor, Flow* out) {
  resample_columns(row, resampling, 0, resampling.size(), factor, out);
}

void resample_columns(const Flow* row, const Resampling& resampling, int first, int last,
                      float factor, Flow* out) {
  HWY_DYNAMIC_DISPATCH(resample_flows)(row, resampling, first, last, factor, out);
}

void blend_rows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out) {
  HWY_DYNAMIC_DISPATCH(blend_flows)(upper, lower, weight, width, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
