// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/denoise_filter.hpp"

#include "src/core/sensor_size.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/filter/double_window.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

int nearest(const DoubleWindow::Window& signal, const DoubleWindow::Window& noise, int x, int y) {
  const hn::CappedTag<std::int16_t, 16> lanes;
  const auto at_x = hn::Set(lanes, static_cast<std::int16_t>(x));
  const auto at_y = hn::Set(lanes, static_cast<std::int16_t>(y));
  auto min = hn::Set(lanes, INT16_MAX);
  for (const auto* window : {&signal, &noise})
    for (std::size_t i = 0; i < window->x.size(); i += hn::Lanes(lanes)) {
      const auto across = hn::Abs(hn::Sub(hn::LoadU(lanes, window->x.data() + i), at_x));
      const auto down = hn::Abs(hn::Sub(hn::LoadU(lanes, window->y.data() + i), at_y));
      min = hn::Min(min, hn::SaturatedAdd(across, down));
    }
  return hn::GetLane(hn::MinOfLanes(lanes, min));
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {
namespace {
HWY_EXPORT(nearest);
}

void DoubleWindow::clear() {
  for (auto* window : {&signal_, &noise_}) {
    window->x.fill(-max_side);
    window->y.fill(-max_side);
    window->next = 0;
  }
}

LabelledEvents DoubleWindow::filter(LabelledEvents events, unsigned distance) {
  return events.keep_if([&](const Event& event) {
    const int found = HWY_DYNAMIC_DISPATCH(nearest)(signal_, noise_, event.x, event.y());
    const bool is_signal = found <= static_cast<int>(distance);
    (is_signal ? signal_ : noise_).add(event);
    return is_signal;
  });
}

}  // namespace eventcamera
#endif
