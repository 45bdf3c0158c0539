// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <cassert>

namespace eventcamera::gl {

bool Simulator::take(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
                     EventList& list) {
  assert(frame.format == format());
  const auto steps = steps_to(time, settings);
  if (steps)
    mark(frame, *steps, settings, list);
  else
    start(frame);
  last_time_ = time;
  return steps.has_value();
}

bool Simulator::queue(const TextureFrame& frame, Nanoseconds time, const Settings& settings) {
  assert(queued_ < max_queued);
  auto& list = lists_[(first_ + queued_) % max_queued];
  const bool ends_interval = take(frame, time, settings, list);
  if (ends_interval) {
    list.sort();
    ++queued_;
  }
  gl_.check();
  return ends_interval;
}

const EventBuckets& Simulator::read() {
  assert(queued_ > 0);
  auto& list = lists_[first_];
  first_ = (first_ + 1) % max_queued;
  --queued_;
  list.read(events_);
  return events_;
}

void Simulator::draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
                     const Picture& picture) {
  auto& list = lists_[first_];
  list.clear();
  take(frame, time, settings, list);
  draw_.run(list, picture);
  gl_.check();
}

void Simulator::simulate(const TextureFrame& frame, const StepTimes& steps,
                         const Settings& settings, EventBuckets& events) {
  auto& list = lists_[first_];
  mark(frame, steps, settings, list);
  list.sort();
  list.read(events);
}

}  // namespace eventcamera::gl
