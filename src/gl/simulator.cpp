// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

namespace eventcamera::gl {

void Simulator::draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
                     const Picture& picture) {
  list_.clear();
  draws_ = true;
  push(frame, time, settings);
  draws_ = false;
  draw_.run(list_, picture);
  gl_.check();
}

void Simulator::simulate(const TextureFrame& frame, const StepTimes& steps,
                         const Settings& settings, EventBuckets& events) {
  mark(frame, steps, settings, list_);
  if (!draws_) list_.read(events);
}

}  // namespace eventcamera::gl
