// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulator.hpp"

#include <cassert>

namespace eventcamera {

const EventBuckets* Simulator::push(const LumaView& frame, Nanoseconds time,
                                    const Settings& settings) {
  assert(frame.format == format_);
  const auto last_time = last_time_;
  last_time_.reset();  // stays so if something is thrown
  threads_.set_threads(settings.threads);
  if (last_time) {
    assert(time > *last_time && time - *last_time <= longest_interval);
    simulate(frame, StepTimes(time - *last_time, settings.interpolated_frames + 1), settings,
             events_);
  } else {
    start(frame);
  }
  last_time_ = time;
  return last_time ? &events_ : nullptr;
}

void Simulator::hold_until(Nanoseconds time) {
  assert(!last_time_ || time >= *last_time_);
  if (last_time_) last_time_ = time;
}

void Simulator::reset() {
  last_time_.reset();
}

}  // namespace eventcamera
