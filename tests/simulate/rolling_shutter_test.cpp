// SPDX-License-Identifier: LGPL-2.1-or-later
// Rolling shutters of every simulator.
#include "src/simulate/rolling_shutter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "src/dvs/dvs_simulator.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

struct Method {
  const char* name;
  std::function<std::unique_ptr<Simulator>(const LumaFormat&)> make;
};

std::unique_ptr<Simulator> make_dvs(const LumaFormat& format, const DvsSettings& settings) {
  auto simulator = make_dvs_simulator(format);
  simulator->set(settings);
  return simulator;
}

const Method methods[] = {
    {"frame", make_frame_simulator},
    {"dense", make_dense_simulator},
    {"sparse", make_sparse_simulator},
    {"diff", make_diff_simulator},
    {"dvs", [](const LumaFormat& format) { return make_dvs(format, {}); }},
    {"dvs_with_noise",
     [](const LumaFormat& format) {
       auto settings = everything();
       settings.max_rate = 0;  // rows that come later wait less
       return make_dvs(format, settings);
     }},
};

/// Delay of a row, microseconds.
Microseconds delay_of(int y, int height, Nanoseconds readout) {
  const int rows_before = readout < 0 ? height - 1 - y : y;
  return std::abs(readout) * rows_before / (height - 1) / 1000;
}

bool is_earlier(const AbsoluteEvent& a, const AbsoluteEvent& b) {
  return std::tuple(a.t, a.y(), a.x, a.y_p) < std::tuple(b.t, b.y(), b.x, b.y_p);
}

/// Collects the events of a simulator, late rows included, with absolute times.
class Recording {
 public:
  explicit Recording(std::unique_ptr<Simulator> simulator) : simulator_(std::move(simulator)) {}

  void push(const LumaView& frame, Nanoseconds time, const Settings& settings) {
    const auto last = simulator_->last_time();
    const auto* made = simulator_->push(frame, time, settings);
    if (made != nullptr) add(*made, *last, time);
  }

  void hold_until(Nanoseconds time, const Settings& settings) {
    const Nanoseconds last = *simulator_->last_time();
    const auto* made = simulator_->hold_until(time, settings);
    if (made != nullptr) add(*made, last, time);
  }

  /// Time of the last frame.
  Nanoseconds end() const { return *simulator_->last_time(); }

  void finish() {
    const auto end = simulator_->late_until();
    if (!end) return;
    const Nanoseconds last = *simulator_->last_time();
    const auto* late = simulator_->late_events(*end);
    ASSERT_TRUE(late);
    add(*late, last, *end);
    EXPECT_EQ(simulator_->late_until(), std::nullopt);
  }

  std::vector<AbsoluteEvent> events;

 private:
  void add(const EventBuckets& interval, Nanoseconds start, Nanoseconds end) {
    auto found = scene::copy(interval);
    std::vector<Label> labels(found.size());
    if (simulator_->has_labels()) simulator_->label({found, labels});
    EXPECT_TRUE(scene::sorted(found));
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_LE(found[i].t, (end - start) / 1000);
      events.emplace_back(start / 1000 + found[i].t, found[i].x, found[i].y_p);
      set_label(events.back(), labels[i]);
    }
  }

  std::unique_ptr<Simulator> simulator_;
};

class EveryMethod : public testing::TestWithParam<Method> {
 protected:
  static constexpr int width = 90;
  static constexpr int height = 70;

  /// Events of a moving texture, in intervals of different durations, and of a pause.
  std::vector<AbsoluteEvent> events_with(Nanoseconds readout, Nanoseconds fraction,
                                         bool labels = false) {
    Recording recording(GetParam().make({width, height, 8}));
    const Settings settings{.threads = 2, .labels = labels, .rolling_shutter = readout};
    Nanoseconds time = 7'000'000;
    for (int i = 0; i < 6; ++i) {
      const auto frame = scene::texture<std::uint8_t>(width, height, 8, 3.0 * i, 2.0 * i);
      recording.push(scene::luma(frame), time, settings);
      time += (i % 2 == 0 ? 33'000'000 : 20'000'000) + fraction;
      if (i == 3) recording.hold_until(time, settings);
      if (i == 3) time += 25'000'000;
    }
    const Microseconds end = recording.end() / 1000 - 17;
    recording.finish();
    // With a latency, late rows also have events that pixels emit after the last frame.
    std::erase_if(recording.events, [&](const AbsoluteEvent& event) {
      return event.t > end + delay_of(event.y(), height, readout);
    });
    return recording.events;
  }
};

INSTANTIATE_TEST_SUITE_P(, EveryMethod, testing::ValuesIn(methods),
                         [](const auto& test) { return test.param.name; });

TEST_P(EveryMethod, DelaysTheEventsOfEachRow) {
  for (const Nanoseconds readout : {20'000'000, -20'000'000, 900, 130'000'000}) {
    auto expected = events_with(0, 0, true);
    for (auto& event : expected) event.t += delay_of(event.y(), height, readout);
    std::ranges::sort(expected, is_earlier);
    const auto found = events_with(readout, 0, true);
    ASSERT_GT(found.size(), 300U);
    ASSERT_EQ(found, expected) << readout;
    for (std::size_t i = 0; i < found.size(); ++i)
      ASSERT_EQ(found[i].cause, expected[i].cause) << readout;
  }
}

TEST_P(EveryMethod, DelaysTheEventsOfIntervalsThatAreNotWholeMicroseconds) {
  constexpr Nanoseconds readout = 50'000'000;
  const auto by_pixel = [](const AbsoluteEvent& a, const AbsoluteEvent& b) {
    return std::tuple(a.y(), a.x, a.t) < std::tuple(b.y(), b.x, b.t);
  };
  auto expected = events_with(0, 333);
  auto found = events_with(readout, 333);
  std::ranges::sort(expected, by_pixel);
  std::ranges::sort(found, by_pixel);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_EQ(found[i].y_p, expected[i].y_p);
    ASSERT_EQ(found[i].x, expected[i].x);
    // A microsecond is lost in each interval that it waits.
    ASSERT_NEAR(static_cast<double>(found[i].t - delay_of(found[i].y(), height, readout)),
                static_cast<double>(expected[i].t), 4);
  }
}

TEST(RollingShutter, MayChangeBetweenFrames) {
  Recording recording(make_frame_simulator({4, 3, 8}));
  const auto push = [&](int grey, Nanoseconds time, Nanoseconds readout) {
    recording.push(scene::luma(scene::flat<std::uint8_t>(4, 3, grey)), time,
                   {.rolling_shutter = readout});
  };
  push(50, 0, 0);
  push(200, 10'000'000, 4'000'000);
  push(50, 20'000'000, 0);
  recording.finish();
  std::vector<AbsoluteEvent> expected;
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x) {
      expected.push_back(AbsoluteEvent::at(x, y, 10'000 + y * 2'000, Polarity::on));
      expected.push_back(AbsoluteEvent::at(x, y, 20'000, Polarity::off));
    }
  std::ranges::sort(expected, is_earlier);
  EXPECT_EQ(recording.events, expected);
}

/// So that two events of a pixel, in different intervals, cannot get the same time.
TEST(RollingShutter, RoundsTheTimesOfDeferredEventsDown) {
  Recording recording(make_frame_simulator({1, 2, 8}));
  const std::pair<int, Nanoseconds> frames[] = {{50, 0}, {200, 10'000'700}, {200, 20'000'000}};
  for (const auto& [grey, time] : frames)
    recording.push(scene::luma(scene::flat<std::uint8_t>(1, 2, grey)), time,
                   {.rolling_shutter = 4'000'000});
  // The second one is at 14,000 us, 3,999.3 us after the frame before.
  const std::vector expected = {AbsoluteEvent::at(0, 0, 10'000, Polarity::on),
                                AbsoluteEvent::at(0, 1, 10'000 + 3'999, Polarity::on)};
  EXPECT_EQ(recording.events, expected);
}

TEST(RollingShutter, DelaysNothingInASingleRow) {
  Recording recording(make_frame_simulator({4, 1, 8}));
  for (const int grey : {50, 200})
    recording.push(scene::luma(scene::flat<std::uint8_t>(4, 1, grey)), grey * 100'000,
                   {.rolling_shutter = 30'000'000});
  EXPECT_EQ(recording.events.size(), 4U);
}

TEST(RollingShutter, DropsTheCausesOfLateEventsOnceThereAreNoLabels) {
  Recording recording(make_dvs({8, 8, 8}, {}));
  for (int i = 0; i < 3; ++i)
    recording.push(scene::luma(scene::flat<std::uint8_t>(8, 8, i * 100)), i * 10'000'000,
                   {.labels = i < 2, .rolling_shutter = 9'000'000});
  recording.finish();
  for (const auto& event : recording.events) {
    ASSERT_LT(event.x, 8);
    ASSERT_LT(event.y(), 8);
  }
}

TEST(RollingShutter, SpreadsTheLoadOfTheReadout) {
  const auto count_with = [](Nanoseconds readout) {
    Recording recording(make_dvs({64, 64, 8}, {.max_rate = 4e5}));
    for (const Nanoseconds ms : {0, 1, 40, 41, 80, 81})  // dark, then bright within a millisecond
      recording.push(scene::luma(scene::flat<std::uint8_t>(64, 64, ms % 2 == 0 ? 20 : 200)),
                     ms * 1'000'000, {.rolling_shutter = readout});
    recording.finish();
    return recording.events.size();
  };
  EXPECT_GT(4 * count_with(30'000'000), 5 * count_with(0));
}

}  // namespace
