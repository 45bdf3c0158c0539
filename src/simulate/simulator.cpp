// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulator.hpp"

#include <algorithm>
#include <cassert>

namespace eventcamera {

std::optional<StepTimes> IntervalSimulator::steps_to(Nanoseconds time, const Settings& settings) {
  threads_.set_threads(settings.threads);
  set_labels(settings.labels);
  if (!last_time_) return std::nullopt;
  assert(time > *last_time_ && time - *last_time_ <= max_interval);
  return StepTimes(time - *last_time_, settings.interpolated_frames + 1);
}

const EventBuckets* IntervalSimulator::hold_until(Nanoseconds time, const Settings& settings) {
  assert(!last_time_ || time >= *last_time_);
  if (!last_time_) return nullptr;
  threads_.set_threads(settings.threads);
  set_labels(settings.labels);
  flow_.reset();
  const Nanoseconds duration = time - *last_time_;
  if (duration > 0 && duration <= max_interval && hold(StepTimes(duration, 1), settings, events_)) {
    last_time_ = time;
    return &finished(duration, settings.rolling_shutter);
  }
  return late_events(time);
}

std::optional<Nanoseconds> IntervalSimulator::late_until() const {
  const auto latest = shutter_.latest();
  if (!last_time_ || !latest) return std::nullopt;
  return *last_time_ + *latest;
}

const EventBuckets* IntervalSimulator::late_events(Nanoseconds time) {
  assert(last_time_ && time >= *last_time_);
  const Nanoseconds duration = time - *last_time_;
  flow_.reset();
  const bool has_late_events = shutter_.latest().has_value();
  last_time_ = time;
  return has_late_events
             ? &read_out(shutter_.delay_none(std::min(duration, max_interval), threads_), duration)
             : nullptr;
}

const EventBuckets& IntervalSimulator::finished(Nanoseconds duration, Nanoseconds rolling_shutter) {
  const bool has_equal_rows = rolling_shutter == 0 && !shutter_.latest();
  return read_out(
      has_equal_rows ? fired() : shutter_.delay(fired(), duration, rolling_shutter, threads_),
      duration);
}

void IntervalSimulator::set_labels(bool labels) {
  if (labels_ && !labels) shutter_.drop_causes();
  labels_ = labels;
}

void IntervalSimulator::reset() {
  last_time_.reset();
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
  return steps ? &finished(steps->duration(), settings.rolling_shutter) : nullptr;
}

}  // namespace eventcamera
