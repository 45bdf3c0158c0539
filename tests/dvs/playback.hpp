// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace eventcamera {

using reference::TimedEvent;  // `t` is relative to the first frame

using Pixels = std::map<std::pair<int, int>, std::vector<TimedEvent>>;

inline Pixels by_pixel(const std::vector<TimedEvent>& events) {
  Pixels pixels;
  for (const auto& event : events) pixels[{event.x, event.y}].push_back(event);
  return pixels;
}

/// Expects the same number of events, up to a fraction `tolerance` (or one event), and a fraction
/// of at least `equal_share` with the expected polarity and cause and a time that differs by at
/// most `precision` microseconds.
inline void expect_near(const std::vector<TimedEvent>& found,
                        const std::vector<TimedEvent>& expected, double tolerance,
                        double equal_share, double precision) {
  const auto count = static_cast<double>(expected.size());
  EXPECT_NEAR(static_cast<double>(found.size()), count, std::max(1.0, tolerance * count));
  auto found_pixels = by_pixel(found);
  double equal = 0;
  for (const auto& [place, events] : by_pixel(expected)) {
    const auto& ours = found_pixels[place];
    for (std::size_t i = 0; i < std::min(events.size(), ours.size()); ++i)
      equal += ours[i].polarity == events[i].polarity && ours[i].cause == events[i].cause &&
               std::abs(ours[i].t - events[i].t) <= precision;
  }
  EXPECT_GT(equal, equal_share * count);
}

/// Pushes frames to a simulator and collects its events.
class Playback {
 public:
  Playback(const LumaFormat& format, const DvsSettings& settings,
           const Settings& common = {.threads = 2})
      : common_(common), simulator_(make_dvs_simulator(format)) {
    simulator_->set(settings);
  }

  template <class Pixel>
  void push(const Image<Pixel>& frame, int bits, Nanoseconds time) {
    const auto last = simulator_->last_time();
    const auto* made = simulator_->push(scene::luma(frame.view(), bits), time, common_);
    if (made == nullptr) return;
    auto interval = scene::copy(*made);
    std::vector<Label> labels(interval.size());
    if (simulator_->has_labels()) simulator_->label({interval, labels});
    EXPECT_TRUE(scene::sorted(interval));
    for (std::size_t i = 0; i < interval.size(); ++i) {
      const auto& event = interval[i];
      EXPECT_LE(event.t, (time - *last) / 1000);
      events.push_back({static_cast<double>(*last) / 1000 + event.t, event.x, event.y(),
                        event.polarity(), labels[i].cause});
    }
  }

  void set(const DvsSettings& settings) { simulator_->set(settings); }
  void set_labels(bool are_made) { common_.labels = are_made; }

  std::vector<TimedEvent> events;

 private:
  Settings common_;
  std::unique_ptr<DvsSimulator> simulator_;
};

inline Image<std::uint8_t> flat(int width, int height, int grey) {
  return scene::flat<std::uint8_t>(width, height, grey);
}

/// Repeats the same image for `frames` frames.
inline void stand(Playback& playback, const Image<std::uint8_t>& picture, int frames,
                  Nanoseconds frame_time) {
  for (int i = 0; i <= frames; ++i) playback.push(picture, 8, i * frame_time);
}

/// Settings with every stage on.
inline DvsSettings everything() {
  return {.denoise = 4,
          .response = Response::log,
          .overexposed_light = 2,
          .cutoff_frequency = 60,
          .threshold_sigma = 0.03,
          .threshold_jitter = 0.02,
          .leak_rate = 3,
          .leak_spread = 0.2,
          .shot_noise_rate = 8,
          .hot_pixels = 0.01,
          .dead_pixels = 0.02,
          .refractory_period = 400'000,
          .refractory_reset = RefractoryReset::signal,
          .exposure_pulse = 0.05,
          .exposure_lead = 9'000'000,
          .pixel_latency = 300'000,
          .pixel_latency_jitter = 100'000,
          .max_rate = 2e7,
          .seed = 11};
}

}  // namespace eventcamera
