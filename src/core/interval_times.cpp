// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/interval_times.hpp"

#define HWY_TARGET_INCLUDE "src/core/interval_times.cpp"
#include <hwy/foreach_target.h>
// Must come after HWY_TARGET_INCLUDE.
#include <hwy/highway.h>

#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// An event is two words: its time, and x and y_p in the lower half of the second.
static_assert(sizeof(AbsoluteEvent) == 2 * sizeof(std::int64_t));
static_assert(offsetof(AbsoluteEvent, x) == 8 && offsetof(AbsoluteEvent, y_p) == 10);
static_assert(offsetof(Event, x) == 4 && offsetof(Event, y_p) == 6);

bool convert(Microseconds start, Microseconds latest, std::span<const AbsoluteEvent> events,
             Event* out) {
  const hn::ScalableTag<std::int64_t> words;
  const auto lanes = hn::Lanes(words);
  const auto* in = reinterpret_cast<const std::int64_t*>(events.data());
  auto falls = hn::Zero(words);
  bool falls_here = false;
  const auto convert_one = [&](std::size_t i) {
    falls_here |= events[i].t < latest;
    latest = events[i].t;
    // Unsigned, because the times of corrupt files may overflow.
    const auto t = static_cast<std::uint64_t>(latest) - static_cast<std::uint64_t>(start);
    out[i] = {static_cast<std::uint32_t>(t), events[i].x, events[i].y_p};
  };
  std::size_t i = 0;
  if (!events.empty()) convert_one(i++);  // the first has no predecessor
  for (; i + lanes <= events.size(); i += lanes) {
    hn::Vec<decltype(words)> before, times, pixels;
    hn::LoadInterleaved2(words, in + 2 * i - 2, before, pixels);
    hn::LoadInterleaved2(words, in + 2 * i, times, pixels);
    falls = hn::Or(falls, hn::VecFromMask(words, times < before));
    const auto relative = hn::And(times - hn::Set(words, start), hn::Set(words, 0xffffffff));
    const auto event = hn::Or(relative, hn::ShiftLeft<32>(pixels));
    hn::StoreU(event, words, reinterpret_cast<std::int64_t*>(out + i));
  }
  if (i > 0 && i < events.size()) latest = events[i - 1].t;
  for (; i < events.size(); ++i) convert_one(i);
  return !falls_here && hn::AllTrue(words, falls == hn::Zero(words));
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(convert);

bool to_interval_times(Microseconds start, Microseconds latest,
                       std::span<const AbsoluteEvent> events, Event* out) {
  return HWY_DYNAMIC_DISPATCH(convert)(start, latest, events, out);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
