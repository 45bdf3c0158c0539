// SPDX-License-Identifier: LGPL-2.1-or-later
// The physical pixel on the GPU against the one on the CPU, which is tested against the plain
// reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/gl/event_sort.hpp"
#include "src/gl/objects.hpp"
#include "src/gl/simulator.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/gl/every_api.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using gl_test::bytes_of;
using gl_test::EveryApi;
using gl_test::Texture;

INSTANTIATE_TEST_SUITE_P(, EveryApi, testing::Bool(), gl_test::name_of_api);

constexpr int width = 97;
constexpr int height = 61;
constexpr Nanoseconds frame_time = 33'333'333;

/// An event whose time counts from the first frame, microseconds.
struct PixelEvent {
  Nanoseconds t;
  bool is_on;
};
using PixelEvents = std::vector<std::vector<PixelEvent>>;  ///< by pixel

/// Simulates with both, and counts how many pixels and events differ.
class Comparison {
 public:
  Comparison(const gl::Context& gl, const DvsSettings& settings)
      : ours_(gl::make_dvs_simulator(gl, format_)), reference_(make_dvs_simulator(format_)) {
    set(settings);
  }

  void set(const DvsSettings& settings) {
    ours_->set(settings);
    reference_->set(settings);
  }

  void push(const Image<std::uint8_t>& frame, Nanoseconds time,
            const std::optional<ImageView<Flow>>& flow = {}) {
    const auto start = ours_->last_time().value_or(time);
    ours_->set_flow(flow);
    const auto* made = gl_test::events_until(*ours_, texture_.show(bytes_of(frame)), time, common);
    const auto* wanted = reference_->push(scene::luma(frame), time, common, flow);
    if (wanted != nullptr) {
      const auto size = static_cast<double>(wanted->size());
      EXPECT_NEAR(static_cast<double>(made->size()), size, 1 + size / 1e3);
    }
    add(made, start, found_);
    add(wanted, start, expected_);
  }

  /// Drops an interval before its events are read, and starts over.
  void restart_after(const Image<std::uint8_t>& frame, Nanoseconds time) {
    ours_->queue(texture_.show(bytes_of(frame)), time, common);
    ours_->drop();
    ours_->reset();
    reference_->reset();
  }

  void hold_until(Nanoseconds time) {
    const auto start = *ours_->last_time();
    add(ours_->hold_until(time, common), start, found_);
    add(reference_->hold_until(time, common), start, expected_);
  }

  void late_events() {
    const auto start = *ours_->last_time();
    ASSERT_EQ(ours_->late_until(), reference_->late_until());
    const auto until = *ours_->late_until();
    add(ours_->late_events(until), start, found_);
    add(reference_->late_events(until), start, expected_);
  }

  /// Expects another number or polarity in at most 1 of 10,000 pixels and intervals, and another
  /// time, by more than a microsecond, for at most 1 of 1,000 events.
  void expect_equal(const std::string& name) const {
    std::size_t events = 0;
    double pixels = 0;
    double times = 0;
    for (std::size_t i = 0; i < expected_.size(); ++i) {
      const auto& ours = found_[i];
      const auto& theirs = expected_[i];
      events += theirs.size();
      const bool is_equal =
          std::ranges::equal(ours, theirs, {}, &PixelEvent::is_on, &PixelEvent::is_on);
      pixels += is_equal ? 0 : 1;
      for (std::size_t k = 0; is_equal && k < ours.size(); ++k)
        times += std::abs(ours[k].t - theirs[k].t) > 1 ? 1 : 0;
    }
    std::cout << name << ": " << events << " events, " << pixels << " pixels and " << times
              << " times differ\n";
    EXPECT_GT(events, expected_.size() / 100) << name;
    EXPECT_LE(pixels, static_cast<double>(expected_.size()) * intervals_ / 1e4) << name;
    EXPECT_LE(times, static_cast<double>(events) / 1e3) << name;
  }

  Settings common{.threads = 2};

 private:
  void add(const EventBuckets* made, Nanoseconds start, PixelEvents& out) {
    if (made == nullptr) return;
    intervals_ += 0.5;  // for each of both
    const auto events = scene::copy(*made);
    EXPECT_TRUE(scene::sorted(events));
    for (const auto& event : events) {
      const int pixel = event.y() * width + event.x;
      out[static_cast<std::size_t>(pixel)].push_back(
          {start / 1000 + event.t, event.polarity() == Polarity::on});
    }
  }

  LumaFormat format_{width, height, 8};
  Texture texture_{width, height, 1};
  std::unique_ptr<gl::DvsSimulator> ours_;
  std::unique_ptr<DvsSimulator> reference_;
  double intervals_ = 0;
  PixelEvents found_{std::size_t{width} * height};
  PixelEvents expected_{std::size_t{width} * height};
};

/// A frame of a texture that moves and changes its speed.
Image<std::uint8_t> moving_frame(int i) {
  return scene::texture<std::uint8_t>(width, height, 8, 0.9 * i + 0.1 * i * i, 0.4 * i);
}

/// A list as EventSort expects it, with room for `capacity` events.
std::vector<Event> list_of(const std::vector<Event>& events, std::size_t capacity) {
  const auto count = static_cast<std::uint32_t>(events.size());
  std::vector<Event> list(1 + capacity);
  list[0] = std::bit_cast<Event>(
      std::array<std::uint32_t, 2>{count, static_cast<std::uint32_t>(capacity)});
  std::copy_n(events.begin(), std::min(events.size(), capacity), list.begin() + 1);
  return list;
}

TEST_P(EveryApi, SortsEventsAndKeepsTheOrderOfEqualOnes) {
  struct Case {
    int width, height;
    std::uint32_t duration;
  };
  std::minstd_rand random(1);
  for (const auto& [columns, rows, duration] : {Case{1, 1, 1},
                                                {5, 3, 700},
                                                {300, 200, 33'333},
                                                {1000, 700, 65'535},
                                                {16'384, 16'384, 0xfffffffe}}) {
    gl::EventSort sort(context, {columns, rows, 8});
    for (const std::size_t count : {0, 1, 255, 256, 257, 100'003}) {
      const auto below = [&](std::uint32_t end) {
        return static_cast<std::uint32_t>(std::uint64_t{random()} * end >> 31);
      };
      std::vector<Event> events(count);
      for (auto& event : events) {
        event = Event::at(static_cast<int>(below(static_cast<std::uint32_t>(columns))),
                          static_cast<int>(below(static_cast<std::uint32_t>(rows))),
                          below(duration + 1), below(2) == 0 ? Polarity::off : Polarity::on);
        if (below(10) == 0) event = with_cause(event, static_cast<Cause>(1 + below(7)));
      }
      const std::size_t capacity = std::max<std::size_t>(1, count - count / 1000);
      const auto list = list_of(events, capacity);
      gl::Buffer sorted(context, GL_DYNAMIC_READ);
      sorted.reserve(list.size() * sizeof(Event));
      sort.unsorted(sorted).assign(std::as_bytes(std::span(list)));
      sort.run(sorted, duration);
      std::vector<Event> found(list.size());
      sorted.read(std::as_writable_bytes(std::span(found)));
      events.resize(std::min(count, capacity));
      std::ranges::stable_sort(events, {}, [](const Event& event) {
        const bool is_late = event != without_cause(event);
        return std::tuple(is_late, is_late ? 0 : event.t, without_cause(event).y(),
                          without_cause(event).x);
      });
      auto expected = list_of(events, capacity);
      expected[0] = list[0];
      ASSERT_TRUE(found == expected) << columns << "x" << rows << ", " << count << " events";
    }
  }
}

TEST_P(EveryApi, SimulatesThePixelsOfEachPreset) {
  for (int preset = 0; preset <= static_cast<int>(DvsPreset::hs_ergb); ++preset) {
    for (const bool follows_motion : {false, true}) {
      auto settings = settings_of(static_cast<DvsPreset>(preset));
      if (follows_motion && settings.upsampling == Upsampling::linear) continue;
      if (!follows_motion) settings.upsampling = Upsampling::linear;
      Comparison comparison(context, settings);
      for (int i = 0; i < 5; ++i) comparison.push(moving_frame(i), 5 + i * frame_time);
      comparison.expect_equal("preset " + std::to_string(preset) +
                              (follows_motion ? ", motion" : ""));
    }
  }
}

TEST_P(EveryApi, KeepsEventsAtTheEndOfTheirInterval) {
  Comparison comparison(context, settings_of(DvsPreset::ideal));
  const auto dark = scene::flat<std::uint8_t>(width, height, 0);
  const auto noise = scene::noise<std::uint8_t>(width, height, 5, 1);
  // Pixels reach their first levels again at the end of an interval, a float of which is later.
  for (int i = 0; i < 5; ++i) comparison.push(i % 2 == 0 ? dark : noise, i * 33'333'334);
  comparison.expect_equal("events at the end");
}

/// Settings with every stage on, and many noise events.
DvsSettings noisy_everything() {
  auto settings = everything();
  settings.exposure_compensation = true;
  settings.leak_rate = 30;
  settings.shot_noise_rate = 80;
  settings.adaptation = 0.1;
  return settings;
}

TEST_P(EveryApi, HoldsFramesAndChangesSettings) {
  auto settings = noisy_everything();
  Comparison comparison(context, settings);
  Nanoseconds time = 1'234;
  for (int i = 0; i < 3; ++i) comparison.push(moving_frame(i), time += frame_time);
  comparison.hold_until(time += 2 * frame_time);
  settings.upsampling = Upsampling::motion;
  settings.threshold_jitter = 0.03;
  settings.exposure_time = 10'000'000;
  comparison.set(settings);
  for (int i = 3; i < 6; ++i) comparison.push(moving_frame(i), time += frame_time);
  comparison.hold_until(time += frame_time);
  settings = {.threshold_sigma = 0.01, .refractory_period = 1'000'000, .seed = 5};
  comparison.set(settings);  // another response, and no work of the CPU
  for (int i = 6; i < 9; ++i) comparison.push(moving_frame(i), time += frame_time);
  comparison.hold_until(time += frame_time);
  comparison.set(noisy_everything());
  for (int i = 9; i < 12; ++i) comparison.push(moving_frame(i), time += frame_time);
  comparison.expect_equal("all stages");
}

TEST_P(EveryApi, FollowsKnownFlowWithARollingShutter) {
  auto settings = settings_of(DvsPreset::standard);
  settings.denoise = 0;
  Comparison comparison(context, settings);
  comparison.common.rolling_shutter = 20'000'000;
  Image<Flow> flow(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) flow.at(x, y) = {0.11F * static_cast<float>(x - y), -1.3F};
  for (int i = 0; i < 4; ++i) comparison.push(moving_frame(i), i * frame_time, flow.view());
  comparison.late_events();
  comparison.expect_equal("known flow");
}

TEST_P(EveryApi, SimulatesMoreEventsThanFitAtFirst) {
  Comparison comparison(context, {.positive_threshold = 0.015, .negative_threshold = 0.02});
  const auto frame = [](unsigned seed) {
    return scene::noise<std::uint8_t>(width, height, 8, seed);
  };
  comparison.push(frame(1), 0);
  comparison.restart_after(frame(2), frame_time);
  for (unsigned i = 3; i < 7; ++i) comparison.push(frame(i), i * frame_time);
  comparison.expect_equal("many events");
}

/// Frames of a noisy camera whose exposure grows.
Image<std::uint8_t> noisy_frame(int i) {
  auto frame = moving_frame(0);
  const auto noise = scene::noise<std::uint8_t>(width, height, 3, static_cast<unsigned>(i));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      frame.at(x, y) = static_cast<std::uint8_t>(
          std::clamp(20 + frame.at(x, y) * (10 + i) / 22 + noise.at(x, y) - 4, 0, 255));
  return frame;
}

TEST_P(EveryApi, RemovesNoiseAndExposureOfTheCamera) {
  auto settings = settings_of(DvsPreset::standard);
  settings.positive_threshold = settings.negative_threshold = 0.05;
  Comparison comparison(context, settings);
  for (int i = 0; i < 5; ++i) comparison.push(noisy_frame(i), i * frame_time);
  comparison.expect_equal("noise and exposure");
}

}  // namespace
