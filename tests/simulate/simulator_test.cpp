// SPDX-License-Identifier: LGPL-2.1-or-later
// Scenes with known events.
#include "src/simulate/simulator.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <map>

#include "src/simulate/simulators.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using scene::frame_time;

struct Method {
  const char* name;
  std::function<std::unique_ptr<Simulator>(const LumaFormat&)> make;
  double threshold;
};

template <FlowMethod flow, Interpolation interpolation>
std::unique_ptr<Simulator> make_dense(const LumaFormat& format) {
  auto simulator = make_dense_simulator(format);
  simulator->set_flow(flow);
  simulator->set_interpolation(interpolation);
  return simulator;
}

const Method methods[] = {
    {"frame", make_frame_simulator, 20},
    {"dense_dis_lq", make_dense<FlowMethod::dis_lq, Interpolation::forward>, 2},
    {"dense_dis_hq", make_dense<FlowMethod::dis_hq, Interpolation::forward>, 2},
    {"dense_farneback", make_dense<FlowMethod::farneback, Interpolation::forward>, 2},
    {"dense_blend", make_dense<FlowMethod::dis_hq, Interpolation::blend>, 2},
    {"sparse", make_sparse_simulator, 10},
    {"diff", make_diff_simulator, 20},
};

class EveryMethod : public testing::TestWithParam<Method> {
 protected:
  Settings settings() const {
    Settings settings;
    settings.positive_threshold = settings.negative_threshold = GetParam().threshold;
    return settings;
  }

  std::vector<Event> events_of(const std::vector<Image<std::uint8_t>>& frames) {
    std::vector<LumaView> views;
    for (const auto& frame : frames) views.push_back(scene::luma(frame));
    const auto simulator = GetParam().make(views.front().format);
    auto events = scene::last_interval(*simulator, settings(), views);
    EXPECT_TRUE(scene::sorted(events));
    return events;
  }
};

INSTANTIATE_TEST_SUITE_P(, EveryMethod, testing::ValuesIn(methods),
                         [](const auto& test) { return test.param.name; });

TEST_P(EveryMethod, FiresEverywhereWhenTheLightGoesOn) {
  const auto events =
      events_of({scene::flat<std::uint8_t>(70, 50, 50), scene::flat<std::uint8_t>(70, 50, 200)});
  // Blending brightens in steps; the others detect no motion and change with the new frame.
  const std::size_t steps = std::string(GetParam().name) == "dense_blend" ? 11 : 1;
  EXPECT_EQ(events.size(), 70U * 50U * steps);
  for (const auto& event : events) ASSERT_EQ(event.polarity(), Polarity::on);
  EXPECT_EQ(events.back().t, frame_time / 1000);
}

TEST_P(EveryMethod, DrawsTheOutlineOfAMovingSquare) {
  const auto at = [](int left) { return scene::square(160, 90, left, 30, 24, 220, 30); };
  // It moves to the right by 8 pixels per interval: the band that it enters, [72, 80), fires ON,
  // the one that it leaves, [48, 56), fires OFF.
  std::map<Polarity, double> sum_x;
  std::map<Polarity, int> count;
  for (const auto& event : events_of({at(40), at(48), at(56)})) {
    sum_x[event.polarity()] += event.x;
    ++count[event.polarity()];
  }
  ASSERT_GE(count[Polarity::on], 24 * 8);
  ASSERT_GE(count[Polarity::off], 24 * 8);
  EXPECT_NEAR(sum_x[Polarity::on] / count[Polarity::on], 75.5, 6);
  EXPECT_NEAR(sum_x[Polarity::off] / count[Polarity::off], 51.5, 6);
}

TEST_P(EveryMethod, DoesNotDependOnThreadsOrOnTheFramesBeforeAReset) {
  const auto looking_at = [](double left) {
    return scene::texture<std::uint8_t>(200, 150, 8, left, -left);
  };
  const auto a = looking_at(0);
  const auto b = looking_at(2.5);
  const auto c = looking_at(5);
  const auto elsewhere = scene::noise<std::uint8_t>(200, 150, 8, 3);
  auto one = settings();
  one.threads = 1;
  auto all = settings();
  all.threads = 0;
  const auto simulator = GetParam().make({200, 150, 8});
  const auto views = {scene::luma(a), scene::luma(b), scene::luma(c)};
  const auto expected = scene::last_interval(*simulator, one, views);
  scene::last_interval(*simulator, all, {scene::luma(elsewhere), scene::luma(a)});
  EXPECT_TRUE(scene::last_interval(*simulator, all, views) == expected);
  EXPECT_TRUE(scene::last_interval(*simulator, one, views) == expected);
}

TEST_P(EveryMethod, PutsEventsIntoTheBucketsOfTheirBand) {
  const auto simulator = GetParam().make({120, 80, 8});
  const EventBuckets* events = nullptr;
  std::vector<Image<std::uint8_t>> frames;
  for (int i = 0; i < 3; ++i) frames.push_back(scene::texture<std::uint8_t>(120, 80, 8, 2 * i, i));
  for (std::size_t i = 0; i < frames.size(); ++i)
    events = simulator->push(scene::luma(frames[i]), static_cast<Nanoseconds>(i) * frame_time,
                             settings());
  ASSERT_NE(events, nullptr);
  ASSERT_GT(events->size(), 0U);
  if (events->bands() == 1) return;  // of all rows
  std::size_t visited = 0;
  for (int band = 0; band < events->bands(); ++band)
    events->visit_band(band, [&](std::span<const Event> some) {
      visited += some.size();
      for (const auto& event : some) ASSERT_EQ(event.y() / rows_per_band, band);
    });
  EXPECT_EQ(visited, events->size());
}

TEST_P(EveryMethod, TakesSettingsFromFrameToFrame) {
  const auto dark = scene::flat<std::uint8_t>(40, 30, 100);
  const auto bright = scene::flat<std::uint8_t>(40, 30, 130);
  const auto simulator = GetParam().make({40, 30, 8});
  auto changing = settings();
  EXPECT_EQ(simulator->push(scene::luma(dark), 0, changing), nullptr);
  changing.positive_threshold = 30;  // 30 does not exceed 30
  EXPECT_EQ(simulator->push(scene::luma(bright), frame_time, changing)->size(), 0U);
  changing.negative_threshold = 1;
  EXPECT_GE(simulator->push(scene::luma(dark), 2 * frame_time, changing)->size(), 40U * 30U);
  changing.positive_threshold = 1;
  EXPECT_GE(simulator->push(scene::luma(bright), 3 * frame_time, changing)->size(), 40U * 30U);
}

TEST_P(EveryMethod, HoldsTheLastFrame) {
  const auto dark = scene::flat<std::uint8_t>(40, 30, 50);
  const auto bright = scene::flat<std::uint8_t>(40, 30, 230);
  const auto simulator = GetParam().make({40, 30, 8});
  simulator->hold_until(5);  // nothing to hold yet
  EXPECT_FALSE(simulator->last_time());
  simulator->push(scene::luma(dark), 0, settings());
  simulator->hold_until(30'000'000);
  const auto events = scene::copy(*simulator->push(scene::luma(bright), frame_time, settings()));
  EXPECT_EQ(events.back().t, 10'000U);
}

TEST(DiffSimulator, ForgetsWhatMovedBeforeAStop) {
  const auto at = [](int left) { return scene::square(160, 90, left, 30, 24, 220, 30); };
  const auto a = at(20);
  const auto b = at(40);
  const auto c = at(48);
  const auto d = at(56);
  const auto after_stop = make_diff_simulator({160, 90, 8});
  const auto without = make_diff_simulator({160, 90, 8});
  const auto events = scene::last_interval(
      *after_stop, {},
      {scene::luma(a), scene::luma(b), scene::luma(b), scene::luma(c), scene::luma(d)});
  EXPECT_EQ(events,
            scene::last_interval(*without, {}, {scene::luma(b), scene::luma(c), scene::luma(d)}));
}

TEST(Thresholds, ScaleWithTheDepth) {
  Settings settings;
  settings.positive_threshold = 20;
  settings.negative_threshold = 0.5;
  EXPECT_EQ(Thresholds::of(settings, 8).positive, 20);
  EXPECT_EQ(Thresholds::of(settings, 8).negative, 0);
  EXPECT_EQ(Thresholds::of(settings, 10).positive, 80);
  EXPECT_EQ(Thresholds::of(settings, 16).positive, 20 * 257);
  EXPECT_EQ(Thresholds::of(settings, 16).negative, 128);
}

}  // namespace
