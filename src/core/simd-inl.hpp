// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by SIMD kernels. Included once per SIMD target, after foreach_target.h.
#if defined(EVENTCAMERA_SIMD_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef EVENTCAMERA_SIMD_INL
#undef EVENTCAMERA_SIMD_INL
#else
#define EVENTCAMERA_SIMD_INL
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>

#include "src/core/event.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Loads the first `count` elements of a vector; the rest is 0. For the end of a row only: slow.
template <class Tag, class T>
hn::Vec<Tag> load_first(Tag tag, const T* from, int count) {
  HWY_ALIGN T elements[hn::MaxLanes(tag)] = {};
  std::copy_n(from, count, elements);
  return hn::Load(tag, elements);
}

/// Coordinates and polarities of pixels, as in the upper half of an Event.
using FiredLanes = hn::CappedTag<std::uint32_t, 16>;

/// OFF events of the pixels of a row, from x on.
inline hn::Vec<FiredLanes> off_events(int x, int y) {
  return hn::Or(hn::Iota(FiredLanes(), static_cast<std::uint32_t>(x)),
                hn::Set(FiredLanes(), static_cast<std::uint32_t>(y) << 16));
}

/// Writes an event for each lane that fired, contiguously and without branches. Always writes as
/// many events as there are lanes; those past the fired ones are garbage.
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
