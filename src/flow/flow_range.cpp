// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/flow_range.hpp"

#define HWY_TARGET_INCLUDE "src/flow/flow_range.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Capped at the usual width of boxes.
using Floats = hn::CappedTag<float, 16>;

FlowRange range_of(const ImageView<Flow>& flow, const Box& box) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const int count = 2 * box.width();
  // Prefetches the box after the next, up to the end of the row: the rows of a box are too far
  // apart for the hardware prefetcher.
  const int ahead = std::min(2 * count, 2 * (flow.width - box.right));
  auto lowest = hn::Zero(floats);
  auto highest = hn::Zero(floats);
  for (int y = box.top; y < box.bottom; ++y) {
    const float* row = &flow.row(y)[box.left].x;
    for (int i = 0; i < count; i += lanes) {
      const auto here = HWY_LIKELY(i + lanes <= count) ? hn::LoadU(floats, row + i)
                                                       : load_first(floats, row + i, count - i);
      __builtin_prefetch(row + i + ahead);
      const auto number = hn::IfThenElseZero(hn::Eq(here, here), here);
      lowest = hn::Min(lowest, number);
      highest = hn::Max(highest, number);
    }
  }
  HWY_ALIGN float min[hn::MaxLanes(Floats())];
  HWY_ALIGN float max[hn::MaxLanes(Floats())];
  hn::Store(lowest, floats, min);
  hn::Store(highest, floats, max);
  FlowRange range{};
  for (int i = 0; i < lanes; ++i) {
    auto& axis = i % 2 == 0 ? range.x : range.y;
    axis = {std::min(axis.min, min[i]), std::max(axis.max, max[i])};
  }
  return range;
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(range_of);

FlowRange flow_range(const ImageView<Flow>& flow, const Box& box) {
  return HWY_DYNAMIC_DISPATCH(range_of)(flow, box);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
