// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares the physical pixel to physics, and to its equations in double precision.
#include "src/dvs/dvs_simulator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <set>

#include "src/dvs/dvs_settings.hpp"
#include "src/flow/dense_flow.hpp"
#include "tests/core/targets.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

constexpr double second = 1e6;

class EverySetting : public testing::TestWithParam<DvsSettings> {};
INSTANTIATE_TEST_SUITE_P(
    , EverySetting,
    testing::Values(
        DvsSettings{}, DvsSettings{.response = Response::log, .cutoff_frequency = 40},
        DvsSettings{.linear_light = true, .cutoff_frequency = 200, .negative_threshold = 0.31},
        DvsSettings{.response = Response::linear, .cutoff_frequency = 15, .leak_rate = 7},
        DvsSettings{.leak_rate = 30, .refractory_period = 900'000},
        DvsSettings{.cutoff_frequency = 100, .refractory_period = 1'500'000},
        DvsSettings{.cutoff_frequency = 100,
                    .leak_rate = 9,
                    .refractory_period = 1'500'000,
                    .refractory_reset = RefractoryReset::signal},
        DvsSettings{.refractory_period = 15'000'000, .refractory_reset = RefractoryReset::signal},
        DvsSettings{.adaptation = 0.4}, DvsSettings{.leak_rate = 30, .adaptation = 1.5},
        DvsSettings{.cutoff_frequency = 100, .adaptation = 0.3, .adaptation_time = 3'000'000},
        DvsSettings{.cutoff_frequency = 15,
                    .leak_rate = 9,
                    .adaptation = 0.6,
                    .refractory_period = 1'500'000,
                    .refractory_reset = RefractoryReset::signal},
        DvsSettings{.threshold_sigma = 0.04, .leak_rate = 9, .leak_spread = 0.2},
        DvsSettings{.threshold_jitter = 0.05, .leak_rate = 9},
        DvsSettings{.threshold_jitter = 0.03, .shot_noise_rate = 30, .adaptation = 0.3},
        DvsSettings{.cutoff_frequency = 100, .threshold_sigma = 0.04, .threshold_jitter = 0.03},
        DvsSettings{.leak_rate = 1, .hot_pixels = 0.3, .dead_pixels = 0.1},
        DvsSettings{.cutoff_frequency = 100, .hot_pixels = 0.5, .adaptation = 0.4},
        DvsSettings{.shot_noise_rate = 90},
        DvsSettings{.linear_light = true,
                    .cutoff_frequency = 100,
                    .leak_rate = 9,
                    .shot_noise_rate = 60,
                    .dead_pixels = 0.1},
        DvsSettings{.shot_noise_rate = 90,
                    .adaptation = 0.4,
                    .refractory_period = 1'500'000,
                    .refractory_reset = RefractoryReset::signal},
        DvsSettings{.exposure_pulse = 0.15, .exposure_lead = 12'300'000},
        DvsSettings{.leak_rate = 9, .adaptation = 0.4, .exposure_pulse = 0.3},
        DvsSettings{.cutoff_frequency = 100,
                    .refractory_period = 1'500'000,
                    .refractory_reset = RefractoryReset::signal,
                    .exposure_pulse = 0.15,
                    .exposure_lead = 400'000}));

TEST_P(EverySetting, EqualsTheReference) {
  constexpr int width = 19;
  constexpr int height = 3;
  const auto settings = GetParam();
  Playback playback({width, height, 16}, settings, {.threads = 2, .labels = true});
  std::vector<reference::DvsPixel> pixels;
  std::vector<TimedEvent> expected;
  for (int i = 0; i < 6; ++i) {
    const auto frame = scene::texture<std::uint16_t>(width, height, 16, 2.3 * i, 1.1 * i);
    playback.push(frame, 16, i * scene::frame_time);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * width + x);
        const double luma = frame.at(x, y) / 65535.0;
        if (i == 0) {
          pixels.emplace_back(settings, pixel, luma);
          continue;
        }
        for (const auto& event : pixels[pixel].push(luma, 40'000))
          expected.push_back({event.t, x, y, event.polarity, event.cause});
      }
    }
  }
  ASSERT_GT(expected.size(), 130U);
  expect_near(playback.events, expected, 0.001, 0.97, 5);
}

TEST(Dvs, MakesShotNoiseThatIsPoisson) {
  const DvsSettings settings{.shot_noise_rate = 20};
  for (const int grey : {0, 128, 255}) {
    Playback playback({64, 48, 8}, settings);
    stand(playback, flat(64, 48, grey), 250, 40'000'000);
    const double rate = 20 * (1 - 0.75 * (grey + 20) / 275);
    const double expected = 64 * 48 * rate * 10;
    EXPECT_NEAR(static_cast<double>(playback.events.size()), expected, 0.02 * expected);
    double on = 0;
    for (const auto& event : playback.events) on += event.polarity == Polarity::on;
    EXPECT_NEAR(on / static_cast<double>(playback.events.size()), 0.5, 0.01);
    // Gaps that begin in the first half are not truncated; they are exponentially distributed.
    double gaps = 0;
    double sum = 0;
    double squares = 0;
    for (const auto& [place, events] : by_pixel(playback.events)) {
      for (std::size_t i = 1; i < events.size() && events[i - 1].t < 5 * second; ++i) {
        const double gap = (events[i].t - events[i - 1].t) / second * rate;
        ++gaps;
        sum += gap;
        squares += gap * gap;
      }
    }
    EXPECT_NEAR(sum / gaps, 1, 0.02);
    EXPECT_NEAR(squares / gaps, 2, 0.08);
  }
}

TEST(Dvs, HasTheSpreadOfThresholdsThatIsSet) {
  constexpr int side = 150;
  const DvsSettings settings{.response = Response::linear, .threshold_sigma = 0.03};
  for (const auto polarity : {Polarity::on, Polarity::off}) {
    Playback playback({side, side, 8}, settings);
    const bool is_on = polarity == Polarity::on;
    playback.push(flat(side, side, is_on ? 100 : 140), 8, 0);
    playback.push(flat(side, side, is_on ? 140 : 100), 8, 1'000'000'000);
    const double a_microsecond = 40 / 255.0 * std::log(255) / second;
    double sum = 0;
    double squares = 0;
    for (const auto& [place, events] : by_pixel(playback.events)) {
      ASSERT_EQ(events[0].polarity, polarity);
      sum += events[0].t * a_microsecond;
      squares += std::pow(events[0].t * a_microsecond - 0.2, 2);
    }
    EXPECT_NEAR(sum / (side * side), 0.2, 0.001);
    EXPECT_NEAR(std::sqrt(squares / (side * side)), 0.03, 0.02 * 0.03);
  }
}

TEST(Dvs, TakesOverexposedPixelsForBrighter) {
  const DvsSettings settings{.response = Response::log,
                             .log_eps = 1e-6,
                             .overexposed_light = 8,
                             .positive_threshold = 0.1};
  for (const bool is_narrow : {false, true}) {
    const int white = is_narrow ? 235 : 255;
    for (const int below : {0, 5, 20, 60}) {
      const int luma = white - below;
      const double light = luma / 100.0 * (below < 20 ? 8 - 7 * below / 20.0 : 1);
      auto simulator = make_dvs_simulator({3, 2, 8});
      simulator->set(settings);
      const auto push = [&](int grey, Nanoseconds time) {
        const auto frame = scene::flat<std::uint8_t>(3, 2, static_cast<std::uint8_t>(grey));
        return simulator->push({{3, 2, 8}, frame.row(0), frame.stride(), is_narrow}, time, {});
      };
      push(100, 0);
      const auto* events = push(luma, 40'000'000);
      EXPECT_EQ(events->size(), 6 * static_cast<std::size_t>(std::log(light) / 0.1))
          << luma << " of " << white;
    }
  }
}

struct Film {
  std::vector<Event> events;
  std::vector<Label> labels;

  friend bool operator==(const Film&, const Film&) = default;
};

/// A short video whose rows have `padding` bytes past their end.
template <class Pixel>
Film film(DvsSimulator& simulator, int width, int height, int bits, const Settings& common,
          int padding = 0) {
  Film film;
  const auto stride = width * static_cast<std::ptrdiff_t>(sizeof(Pixel)) + padding;
  std::vector<std::uint8_t> memory(static_cast<std::size_t>(stride * height), 0xa5);
  for (int i = 0; i < 4; ++i) {
    const auto frame = scene::texture<Pixel>(width, height, bits, 2.6 * i, -1.3 * i);
    for (int y = 0; y < height; ++y)
      std::memcpy(memory.data() + y * stride, frame.row(y),
                  static_cast<std::size_t>(width) * sizeof(Pixel));
    const auto* made =
        simulator.push({{width, height, bits}, memory.data(), stride}, i * 33'333'333LL, common);
    if (made == nullptr) continue;
    auto events = scene::copy(*made);
    std::vector<Label> labels(events.size());
    if (simulator.has_labels()) simulator.label({events, labels});
    EXPECT_TRUE(scene::sorted(events));
    film.events.insert(film.events.end(), events.begin(), events.end());
    film.labels.insert(film.labels.end(), labels.begin(), labels.end());
  }
  return film;
}

TEST(Dvs, IsTheSameForAllThreadsStridesAndTargetsAndWithLabels) {
  struct Size {
    int width, height;
  };
  for (const auto& size : {Size{1, 1}, Size{3, 17}, Size{31, 33}, Size{97, 61}, Size{130, 40}}) {
    auto along_motion = everything();
    along_motion.upsampling = Upsampling::motion;
    along_motion.max_interpolated_frames = 4;
    for (const auto& settings :
         {everything(), along_motion, settings_of(DvsPreset::v2e_noisy),
          settings_of(DvsPreset::davis346), DvsSettings{.leak_rate = 5, .adaptation = 0.3}}) {
      for (const int bits : {8, 10, 12, 16}) {
        const auto play = [&](int threads, bool has_labels, int padding) {
          const auto simulator = make_dvs_simulator({size.width, size.height, bits});
          simulator->set(settings);
          const auto play_depth = bits == 8 ? film<std::uint8_t> : film<std::uint16_t>;
          return play_depth(*simulator, size.width, size.height, bits,
                            {.threads = threads, .labels = has_labels}, padding);
        };
        const auto expected = play(1, true, 0);
        EXPECT_TRUE(play(2, false, 14).events == expected.events);
        targets::for_each([&](const char* target) {
          EXPECT_TRUE(play(2, true, 0) == expected)
              << target << " " << size.width << "x" << size.height;
        });
      }
    }
  }
}

TEST(Dvs, ForgetsAndRepeatsItself) {
  auto settings = everything();
  const auto simulator = make_dvs_simulator({60, 40, 8});
  const auto play = [&] {
    simulator->set(settings);
    simulator->reset();
    return film<std::uint8_t>(*simulator, 60, 40, 8, {.threads = 2}).events;
  };
  const auto expected = play();
  EXPECT_TRUE(play() == expected);
  settings.seed = 12;
  EXPECT_FALSE(play() == expected);
}

TEST(Dvs, GoesOnWhileTheLastFrameStands) {
  const auto grey = flat(50, 40, 100);
  const DvsSettings settings{.leak_rate = 10};
  auto simulator = make_dvs_simulator({50, 40, 8});
  simulator->set(settings);
  EXPECT_EQ(simulator->hold_until(5), nullptr);
  simulator->push(scene::luma(grey), 0, {});
  const auto* held = simulator->hold_until(1'000'000'000);
  ASSERT_NE(held, nullptr);
  EXPECT_NEAR(static_cast<double>(held->size()), 50 * 40 * 10, 0.02 * 50 * 40 * 10);
  const auto* next = simulator->push(scene::luma(grey), 1'500'000'000, {});
  EXPECT_NEAR(static_cast<double>(next->size()), 50 * 40 * 5, 0.02 * 50 * 40 * 5);
}

TEST(Dvs, IsBoundedWhateverComes) {
  auto settings = everything();
  settings.positive_threshold = settings.negative_threshold = 0;
  settings.threshold_sigma = settings.threshold_jitter = 0;
  settings.log_eps = 1e-6;
  settings.shot_noise_rate = settings.leak_rate = 10'000;
  settings.refractory_period = settings.pixel_latency = settings.pixel_latency_jitter = 0;
  settings.max_rate = 0;
  for (const double cutoff_frequency : {0.0, 1e-9, 1e6}) {
    settings.cutoff_frequency = cutoff_frequency;
    Playback playback({20, 10, 8}, settings);
    Nanoseconds time = 0;
    const Nanoseconds gaps[] = {1, 999, 1001, 40'000'000, max_interval};
    playback.push(flat(20, 10, 0), 8, time);
    for (int i = 0; i < 10; ++i)
      playback.push(flat(20, 10, i % 2 == 0 ? 255 : 0), 8, time += gaps[i % 5]);
    EXPECT_LE(playback.events.size(), 20U * 10U * 512U * 10U);
    EXPECT_GT(playback.events.size(), 20U * 10U * 100U);
  }
}

TEST(Dvs, DoesNotSeeTheNoiseOfFramesThatAreDenoised) {
  const auto count_of = [](double denoise) {
    Playback playback({80, 60, 8}, {.denoise = denoise});
    std::minstd_rand random(9);
    std::normal_distribution<> normal(0, 2);
    for (int i = 0; i < 10; ++i) {
      auto frame = flat(80, 60, 30);
      for (int y = 0; y < frame.height(); ++y)
        for (int x = 0; x < frame.width(); ++x)
          frame.at(x, y) = static_cast<std::uint8_t>(std::lround(30 + normal(random)));
      playback.push(frame, 8, i * 40'000'000LL);
    }
    return playback.events.size();
  };
  const auto noisy = count_of(0);
  EXPECT_GT(noisy, 100U);
  EXPECT_LT(count_of(8), noisy / 50);
}

TEST(Dvs, HasItsShareOfDeadPixels) {
  Playback dead({200, 150, 8}, DvsSettings{.shot_noise_rate = 10, .dead_pixels = 0.1});
  dead.push(flat(200, 150, 10), 8, 0);
  dead.push(flat(200, 150, 240), 8, 40'000'000);
  EXPECT_NEAR(static_cast<double>(by_pixel(dead.events).size()), 27'000, 300);
}

TEST(Dvs, FiresOnDuringAPulseAlongMotion) {
  const auto on_within_pulses = [](double pulse) {
    Playback playback(
        {90, 40, 8},
        {.upsampling = Upsampling::motion, .exposure_pulse = pulse, .exposure_lead = 21'234'000});
    for (int i = 0; i < 5; ++i)
      playback.push(scene::texture<std::uint8_t>(90, 40, 8, 3.0 * i, i), 8, i * 40'000'000LL);
    return std::ranges::count_if(playback.events, [](const TimedEvent& event) {
      const double t = std::fmod(event.t, 40'000) - (40'000 - 21'234);
      return event.polarity == Polarity::on && t >= 0 && t <= 100;
    });
  };
  EXPECT_GT(on_within_pulses(0.1), 20 * on_within_pulses(0));
}

TEST(Dvs, SendsEventsAsLateAsItsLatency) {
  const auto dark = flat(6, 5, 40);
  const auto bright = flat(6, 5, 200);
  const auto play = [&](Nanoseconds latency) {
    Playback playback({6, 5, 8}, DvsSettings{.positive_threshold = 0.5, .pixel_latency = latency});
    playback.push(dark, 8, 0);
    playback.push(bright, 8, 40'000'000);
    playback.push(bright, 8, 80'000'000);
    playback.push(bright, 8, 120'000'000);
    return playback.events;
  };
  const auto prompt = play(0);
  const auto late = play(25'000);
  ASSERT_EQ(prompt.size(), 6U * 5U * 3U);
  ASSERT_EQ(late.size(), prompt.size());
  for (std::size_t i = 0; i < prompt.size(); ++i) EXPECT_NEAR(late[i].t, prompt[i].t + 25, 1);
  // No event is lost at the end of the interval, but a pixel has one pending event at a time.
  const auto later = play(45'000'000);
  EXPECT_EQ(later.size(), 6U * 5U);
  EXPECT_GT(later.front().t, 45'000);
}

TEST(Dvs, ReadsOutNoMoreThanItCan) {
  constexpr int width = 40;
  constexpr int height = 30;
  const auto play = [&](double rate) {
    Playback playback({width, height, 8}, DvsSettings{.max_rate = rate});
    for (int i = 0; i < 8; ++i)
      playback.push(scene::texture<std::uint8_t>(width, height, 8, 3.0 * i, 2.0 * i), 8,
                    i * scene::frame_time);
    for (int i = 8; i < 40; ++i)
      playback.push(scene::texture<std::uint8_t>(width, height, 8, 21, 14), 8,
                    i * scene::frame_time);
    return playback.events;
  };
  const auto all = play(0);
  EXPECT_EQ(play(1e12).size(), all.size());
  const auto fast = play(1e6);
  EXPECT_GT(static_cast<double>(fast.size()), 0.99 * static_cast<double>(all.size()));
  const auto slow = play(20'000);
  EXPECT_LT(slow.size(), all.size());
  EXPECT_GT(slow.size(), 3000U);
  // Never exceeds the rate, plus the rows being read.
  for (std::size_t i = 500; i < slow.size(); ++i)
    ASSERT_GE(slow[i].t - slow[i - 500].t, (500 - 2 * width) / 20'000.0 * second - 1);
  // Events that leave together belong to one row.
  for (std::size_t i = 1; i < slow.size(); ++i)
    ASSERT_TRUE(slow[i].t != slow[i - 1].t || slow[i].y == slow[i - 1].y);
}

TEST(Dvs, ReadsOutAllThatWaitsOnceItCan) {
  Playback playback({40, 30, 8}, DvsSettings{.max_rate = 10});
  playback.push(flat(40, 30, 100), 8, 0);
  playback.push(flat(40, 30, 130), 8, scene::frame_time);
  EXPECT_EQ(playback.events.size(), 40U);  // whose readout takes 4 s
  playback.set({});
  playback.push(flat(40, 30, 130), 8, 2 * scene::frame_time);
  EXPECT_EQ(playback.events.size(), 40U * 30U);
}

class AlongMotion : public testing::TestWithParam<DvsSettings> {};
INSTANTIATE_TEST_SUITE_P(
    , AlongMotion,
    testing::Values(DvsSettings{}, DvsSettings{.response = Response::log, .log_eps = 0.05},
                    DvsSettings{.response = Response::linear, .leak_rate = 23, .adaptation = 0.3},
                    DvsSettings{.overexposed_light = 3},
                    DvsSettings{.cutoff_frequency = 330, .leak_rate = 30},
                    DvsSettings{.positive_threshold = 0.5,
                                .negative_threshold = 0.7,
                                .leak_rate = 100,
                                .refractory_period = 270'000}));

TEST_P(AlongMotion, EqualsTheReference) {
  constexpr int width = 110;
  constexpr int height = 45;
  constexpr int microseconds = 2'520;  // a whole number per step, up to 8 of them
  auto settings = GetParam();
  settings.upsampling = Upsampling::motion;
  settings.max_interpolated_frames = 7;
  Playback playback({width, height, 8}, settings);
  std::vector<reference::DvsPixel> pixels;
  std::vector<TimedEvent> expected;
  std::set<int> steps_seen;
  Image<std::uint8_t> last;
  const auto finder = make_dense_flow(FlowMethod::dis_mq);
  ThreadPool threads;
  for (int i = 0; i < 3; ++i) {
    // A square crosses a texture that hardly moves, and an area that is flat.
    auto frame = scene::texture<std::uint8_t>(width, height, 8, 0.7 * i, 0.4 * i);
    const auto square = scene::square(width, height, 15 + 9 * i, 8 + 2 * i, 24, 220, 0);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (x >= 80) frame.at(x, y) = 120;
        if (square.at(x, y) > 0) frame.at(x, y) = square.at(x, y);
      }
    }
    playback.push(frame, 8, i * 1000LL * microseconds);
    Image<Flow> flow(width, height);
    if (i > 0) flow.assign(finder->find(last.view(), frame.view(), threads));
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto number = static_cast<std::size_t>(y * width + x);
        if (i == 0) {
          pixels.emplace_back(settings, number, frame.at(x, y) / 255.0);
          continue;
        }
        const int steps = reference::steps_of_tile(flow, x, y, 8);
        steps_seen.insert(steps);
        for (int j = 1; j <= steps; ++j) {
          const double luma =
              j < steps ? reference::moving_luma(last, frame, flow.at(x, y), x, y, j, steps)
                        : frame.at(x, y);
          for (const auto& event : pixels[number].push(luma / 255, microseconds / steps))
            expected.push_back({event.t, x, y, event.polarity});
        }
      }
    }
    last = frame;
  }
  EXPECT_GT(steps_seen.size(), 4U);
  ASSERT_GT(expected.size(), 1500U);
  expect_near(playback.events, expected, 0.002, 0.97, 2);
}

TEST(Dvs, KeepsThresholdsThatEventsHaveDrawnWhenSettingsChange) {
  const auto events_with = [](const auto& change) {
    DvsSettings settings{
        .positive_threshold = 0.3, .negative_threshold = 0.3, .threshold_jitter = 0.1};
    Playback playback({30, 20, 8}, settings);
    for (int i = 0; i < 60; ++i) {
      change(settings, i % 2);
      playback.set(settings);
      playback.push(flat(30, 20, 4 * i), 8, i * Nanoseconds{1'000'000});
    }
    return playback.events;
  };
  const auto expected = events_with([](DvsSettings&, int) {});
  EXPECT_GT(expected.size(), 30U * 20U * 10U);
  expect_near(events_with([](DvsSettings& s, int odd) { s.exposure_lead = 1000 * odd; }), expected,
              0, 0.9999, 0);
  expect_near(events_with([](DvsSettings& s, int odd) { s.leak_rate = 1e-9 * odd; }), expected,
              0.001, 0.99, 2);
  expect_near(events_with([](DvsSettings& s, int odd) { s.positive_threshold = 0.3 + 1e-9 * odd; }),
              expected, 0.001, 0.99, 2);
}

TEST(Dvs, TakesSettingsFromFrameToFrame) {
  Playback playback({30, 20, 8}, DvsSettings{});
  Nanoseconds time = 0;
  const auto push = [&](int grey) {
    playback.events.clear();
    playback.push(flat(30, 20, grey), 8, time += 40'000'000);
    return playback.events.size();
  };
  push(100);
  EXPECT_EQ(push(150), 30U * 20U * 2U);
  playback.set({.positive_threshold = 1});
  EXPECT_EQ(push(200), 0U);
  playback.set({.response = Response::log});  // other units: starts over
  EXPECT_EQ(push(200), 0U);
  playback.set({.response = Response::log, .cutoff_frequency = 1});
  EXPECT_EQ(push(220), 0U);
  playback.set({.response = Response::log, .upsampling = Upsampling::motion});
  EXPECT_EQ(push(220), 0U);
  EXPECT_EQ(push(120), 30U * 20U * 2U);  // from the last crossing of 200
}

}  // namespace
