// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/filter/filter.hpp"
#include "src/filter/stamped_pixels.hpp"

namespace eventcamera {

/// Keeps the events that pixels with this refractory period would fire: at least the period after
/// the pixel's last kept event. 4 bytes per pixel.
class RefractoryFilter {
 public:
  struct Settings {
    Nanoseconds refractory_period = 1'000'000;  ///< 0 to max_filter_time
  };

  explicit RefractoryFilter(SensorSize sensor) : last_kept_(sensor) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings) {
    const Stamp period = in_stamps(settings.refractory_period);
    return last_kept_.keep_if(events, start, [period](const Event&, Stamp now, Stamp* last) {
      const bool is_kept = now - *last >= period;
      *last = is_kept ? now : *last;
      return is_kept;
    });
  }

  void forget() { last_kept_.forget(); }

 private:
  StampedPixels<Stamp> last_kept_;
};
static_assert(Filter<RefractoryFilter>);

}  // namespace eventcamera
