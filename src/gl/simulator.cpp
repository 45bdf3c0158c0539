// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <cassert>

namespace eventcamera::gl {

bool Simulator::process(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
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

void Simulator::queue(const TextureFrame& frame, Nanoseconds time, const Settings& settings) {
  auto& [list, is_sorted, done] = next();
  is_sorted = process(frame, time, settings, list);
  if (is_sorted) list.sort();
  done.set();
  gl_.check();
}

void Simulator::draw(const TextureFrame& frame, Nanoseconds time, const Settings& settings,
                     const Picture& picture) {
  auto& [list, is_sorted, done] = next();
  is_sorted = false;
  list.clear();
  process(frame, time, settings, list);
  draw_.run(list, picture);
  done.set();
  gl_.check();
}

Simulator::Queued& Simulator::next() {
  assert(queued_ < max_queued);
  return queue_[(first_ + queued_++) % max_queued];
}

const EventBuckets* Simulator::read() {
  assert(queued_ > 0);
  auto& [list, is_sorted, done] = queue_[first_];
  first_ = (first_ + 1) % max_queued;
  --queued_;
  done.wait();
  if (!is_sorted) return nullptr;
  list.read(events_);
  return &events_;
}

}  // namespace eventcamera::gl
