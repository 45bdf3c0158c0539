// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulator.hpp"

#include <algorithm>
#include <cassert>

namespace eventcamera {

std::optional<StepTimes> IntervalSimulator::steps_to(Nanoseconds time, const Settings& settings) {
  threads_.set_threads(settings.threads);
  labels_ = settings.labels;
  if (!last_time_) return std::nullopt;
  assert(time > *last_time_ && time - *last_time_ <= max_interval);
  return StepTimes(time - *last_time_, settings.interpolated_frames + 1);
}

const EventBuckets* IntervalSimulator::hold_until(Nanoseconds time, const Settings& settings) {
  assert(!last_time_ || time >= *last_time_);
  if (!last_time_) return nullptr;
  threads_.set_threads(settings.threads);
  labels_ = settings.labels;
  flow_.reset();
  const Nanoseconds duration = time - *last_time_;
  if (duration > 0 && duration <= max_interval && hold(StepTimes(duration, 1), settings, events_)) {
    last_time_ = time;
    return &events(duration, settings);
  }
  return late_events(time);
}

std::optional<Nanoseconds> IntervalSimulator::late_until() const {
  const auto time = latest();
  if (!last_time_ || !time) return std::nullopt;
  return *last_time_ + *time;
}

const EventBuckets* IntervalSimulator::late_events(Nanoseconds time) {
  assert(last_time_ && time >= *last_time_);
  const Nanoseconds duration = std::min(time - *last_time_, max_interval);
  flow_.reset();
  last_time_ = time;
  return latest() ? &late(duration) : nullptr;
}

const EventBuckets& IntervalSimulator::events(Nanoseconds duration, const Settings& settings) {
  if (settings.rolling_shutter == 0 && !delayed_.latest()) return events_;
  delayed_.set(events_, duration, settings.rolling_shutter);
  return delayed_;
}

const EventBuckets& IntervalSimulator::late(Nanoseconds duration) {
  delayed_.set({}, duration, 0);
  return delayed_;
}

void IntervalSimulator::reset() {
  last_time_.reset();
  delayed_.restart();
}

const EventBuckets* Simulator::push(const LumaView& frame, Nanoseconds time,
                                    const Settings& settings,
                                    const std::optional<ImageView<Flow>>& known_flow) {
  assert(frame.format == format());
  const auto steps = steps_to(time, settings);
  flow_ = steps ? known_flow : std::nullopt;
  if (!steps) denoiser_.restart();
  const double amplitude = denoiser_.amplitude_for(frame, denoise_setting(settings));
  if (steps) {
    if (const auto first = denoiser_.kept_first(amplitude, threads())) start(*first);
    simulate(denoiser_.denoised(frame, amplitude, threads()), *steps, settings, events_);
  } else {
    start(denoiser_.denoised(frame, amplitude, threads()));
  }
  last_time_ = time;
  return steps ? &events(steps->duration(), settings) : nullptr;
}

}  // namespace eventcamera
