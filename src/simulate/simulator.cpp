// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulator.hpp"

#include <cassert>

namespace eventcamera {

const EventBuckets* Simulator::push(const LumaView& frame, Nanoseconds time,
                                    const Settings& settings) {
  assert(frame.format == format_);
  threads_.set_threads(settings.threads);
  const bool is_first = !last_time_;
  if (is_first) {
    start(frame);
  } else {
    assert(time > *last_time_ && time - *last_time_ <= max_interval);
    simulate(frame, StepTimes(time - *last_time_, settings.interpolated_frames + 1), settings,
             events_);
  }
  last_time_ = time;
  return is_first ? nullptr : &events_;
}

const EventBuckets* Simulator::hold_until(Nanoseconds time, const Settings& settings) {
  assert(!last_time_ || time >= *last_time_);
  if (!last_time_) return nullptr;
  const Nanoseconds duration = time - *last_time_;
  last_time_ = time;
  if (duration <= 0 || duration > max_interval) return nullptr;
  threads_.set_threads(settings.threads);
  return hold(StepTimes(duration, 1), settings, events_) ? &events_ : nullptr;
}

void Simulator::reset() {
  last_time_.reset();
}

}  // namespace eventcamera
