// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <cassert>

namespace eventcamera::gl {

std::optional<StepTimes> Simulator::process(const TextureFrame& frame, Nanoseconds time,
                                            const Settings& settings, EventList& list) {
  assert(frame.format == format());
  const auto steps = steps_to(time, settings);
  if (steps)
    mark(frame, *steps, settings, list);
  else
    start(frame);
  last_time_ = time;
  return steps;
}

void Simulator::queue(const TextureFrame& frame, Nanoseconds time, const Settings& settings) {
  auto& queued = next();
  const auto steps = process(frame, time, settings, queued.list);
  queued.is_sorted = steps.has_value();
  if (steps) {
    queued.duration = steps->duration();
    queued.settings = settings;
    if (queued.list.steps() > 0) queued.list.sort();
  }
  queued.done.set();
  gl_.check();
}

void Simulator::draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
                     const Picture& picture) {
  auto& queued = next();
  queued.is_sorted = false;
  queued.list.clear();
  const auto steps = process(frame, time, settings, queued.list);
  if (steps) mark_events(*steps, settings, queued.list);
  draw_.run(queued.list, picture);
  queued.done.set();
  gl_.check();
}

Simulator::Queued& Simulator::next() {
  assert(queued_ < max_queued);
  return queue_[(first_ + queued_++) % max_queued];
}

const EventBuckets* Simulator::read() {
  assert(queued_ > 0);
  auto& queued = queue_[first_];
  first_ = (first_ + 1) % max_queued;
  --queued_;
  queued.done.wait();
  if (!queued.is_sorted) return nullptr;
  if (queued.list.steps() > 0) queued.list.read(events_);
  return &events(queued.duration, queued.settings);
}

}  // namespace eventcamera::gl
