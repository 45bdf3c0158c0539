// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dis/upsampling.hpp"

#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/flow/dis/upsampling.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Floats = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Floats>;

Vector between(Vector a, Vector b, Vector weight) {
  return hn::Add(a, hn::Mul(weight, hn::Sub(b, a)));
}

void widen(const Flow* row, const Resampling& columns, float factor, Flow* out) {
  const Floats floats;
  const hn::RebindToSigned<Floats> ints;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto times = hn::Set(floats, factor);
  const float* values = &row->x;
  for (int x = 0; x < columns.size(); x += lanes) {
    const auto first = hn::ShiftLeft<1>(hn::LoadU(ints, columns.first() + x));
    const auto right = hn::LoadU(floats, columns.weight() + x);
    const auto at = [&](int i) { return hn::GatherIndex(floats, values + i, first); };
    hn::StoreInterleaved2(hn::Mul(between(at(0), at(2), right), times),
                          hn::Mul(between(at(1), at(3), right), times), floats, &out[x].x);
  }
}

void blend(const Flow* upper, const Flow* lower, float weight, int width, Flow* out) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const auto down = hn::Set(floats, weight);
  for (int i = 0; i < 2 * width; i += lanes)
    hn::StoreU(between(hn::LoadU(floats, &upper->x + i), hn::LoadU(floats, &lower->x + i), down),
               floats, &out->x + i);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(widen);
HWY_EXPORT(blend);

void widen_flow(const Flow* row, const Resampling& columns, float factor, Flow* out) {
  HWY_DYNAMIC_DISPATCH(widen)(row, columns, factor, out);
}

void blend_flows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out) {
  HWY_DYNAMIC_DISPATCH(blend)(upper, lower, weight, width, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
