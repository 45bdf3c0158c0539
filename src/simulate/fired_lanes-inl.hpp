// SPDX-License-Identifier: LGPL-2.1-or-later
// Events of lanes that fired, in SIMD. Included once for each SIMD target, by what foreach_target.h
// compiles.
#if defined(EVENTCAMERA_FIRED_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_FIRED_LANES_INL
#undef EVENTCAMERA_FIRED_LANES_INL
#else
#define EVENTCAMERA_FIRED_LANES_INL
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "src/core/event.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Where pixels are and which way they fired, as the upper half of an Event has it.
using FiredLanes = hn::CappedTag<std::uint32_t, 16>;

/// A row of pixels from x on, all of them OFF.
inline hn::Vec<FiredLanes> off_events(int x, int y) {
  return hn::Or(hn::Iota(FiredLanes(), static_cast<std::uint32_t>(x)),
                hn::Set(FiredLanes(), static_cast<std::uint32_t>(y) << 16));
}

/// Writes an event for each lane that fired, one after the other without a branch for each. What
/// lies behind them is overwritten, as far as there are lanes.
inline void store_fired(hn::Vec<FiredLanes> off_events, hn::Mask<FiredLanes> fired,
                        hn::Mask<FiredLanes> on, std::uint32_t t, Event* out) {
  const FiredLanes lanes;
  const auto polarity = hn::IfThenElseZero(on, hn::Set(lanes, 0x80000000U));
  const auto events = hn::Compress(hn::Or(off_events, polarity), fired);
  hn::StoreInterleaved2(hn::Set(lanes, t), events, lanes, reinterpret_cast<std::uint32_t*>(out));
}

}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
