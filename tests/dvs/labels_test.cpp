// SPDX-License-Identifier: LGPL-2.1-or-later
// The causes of simulated events.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "tests/dvs/playback.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

constexpr Settings labelled{.threads = 2, .labels = true};

/// Number of events by cause.
class Counts {
 public:
  explicit Counts(const std::vector<TimedEvent>& events) {
    for (const auto& event : events) ++of_[static_cast<std::size_t>(event.cause)];
  }
  double operator[](Cause cause) const { return of_[static_cast<std::size_t>(cause)]; }
  double all() const { return std::accumulate(of_.begin(), of_.end(), 0.0); }

 private:
  std::array<double, 6> of_{};
};

/// Frames of a moving texture.
Image<std::uint8_t> moving(int width, int height, int i) {
  return scene::texture<std::uint8_t>(width, height, 8, 2.3 * i, 1.1 * i);
}

TEST(Labels, AreNeverLightWhereLightIsConstant) {
  auto slow = everything();
  slow.max_rate = 1e5;
  for (const auto& settings :
       {everything(), slow, settings_of(DvsPreset::davis346), settings_of(DvsPreset::v2e_noisy),
        DvsSettings{.leak_rate = 7, .adaptation = 0.3, .refractory_period = 300'000},
        DvsSettings{.leak_rate = 7,
        .hot_pixels = 0.02,
        .exposure_pulse = 0.45,
        .exposure_lead = 9'000'000}}) {
    Playback playback({96, 80, 8}, settings, labelled);
    stand(playback, scene::texture<std::uint8_t>(96, 80, 8, 3, 4), 50, 40'000'000);
    const Counts counts(playback.events);
    EXPECT_GT(counts.all(), 1000);
    EXPECT_EQ(counts[Cause::light], 0);
    EXPECT_EQ(counts[Cause::unknown], 0);
  }
}

// Within three standard errors.
TEST(Labels, MeetTheRatesThatAreSet) {
  constexpr int pixels = 100 * 90;
  constexpr double seconds = 10;
  const auto counts_with = [&](const DvsSettings& settings) {
    Playback playback({100, 90, 8}, settings, labelled);
    stand(playback, flat(100, 90, 0), 50, 200'000'000);
    return Counts(playback.events);
  };
  // A pixel's leak fires at regular times, of which one more or less lies in the recording.
  const auto leak = counts_with({.threshold_sigma = 0.03, .leak_rate = 5});
  EXPECT_NEAR(leak[Cause::leak], 5 * pixels * seconds, 3 * std::sqrt(pixels / 4.0));
  EXPECT_EQ(leak[Cause::leak], leak.all());

  const auto noise = counts_with({.threshold_sigma = 0.03, .shot_noise_rate = 6});
  const double noise_rate = 6 * (1 - 0.75 * 20 / 275);
  const double expected_noise = noise_rate * pixels * seconds;
  EXPECT_NEAR(noise[Cause::shot_noise], expected_noise, 3 * std::sqrt(expected_noise));
  EXPECT_EQ(noise[Cause::shot_noise], noise.all());

  // Log-uniform between 10 and 1000 Hz.
  const auto hot = counts_with({.hot_pixels = 0.02});
  const double hot_rate = 0.02 * 990 / std::log(100);
  const double squared_rate = 0.02 * (1e6 - 100) / (2 * std::log(100));
  EXPECT_NEAR(hot[Cause::hot_pixel], hot_rate * pixels * seconds,
              3 * std::sqrt((squared_rate - hot_rate * hot_rate) * pixels) * seconds);
  EXPECT_EQ(hot[Cause::hot_pixel], hot.all());

  // Noise resets a pixel, so its leak fires only if there is none for 1/5 of a second.
  const auto both = counts_with({.leak_rate = 5, .shot_noise_rate = 6});
  EXPECT_NEAR(both[Cause::shot_noise], expected_noise, 3 * std::sqrt(expected_noise));
  const double undisturbed = std::exp(-noise_rate / 5);
  const double expected_leak = noise_rate * undisturbed / (1 - undisturbed) * pixels * seconds;
  EXPECT_NEAR(both[Cause::leak], expected_leak, 3 * std::sqrt(expected_leak));
  EXPECT_EQ(both[Cause::leak] + both[Cause::shot_noise], both.all());
}

TEST(Labels, MayBeginAndEndWithAnyFrame) {
  auto settings = everything();
  settings.max_rate = 1e6;
  settings.pixel_latency = 10'000'000;
  Playback playback({60, 40, 8}, settings, {.threads = 2});
  Playback unlabelled({60, 40, 8}, settings, {.threads = 2});
  for (int i = 0; i < 12; ++i) {
    const bool has_labels = i % 4 >= 2;
    playback.set_labels(has_labels);
    playback.events.clear();
    unlabelled.events.clear();
    playback.push(moving(60, 40, i), 8, i * 40'000'000LL);
    unlabelled.push(moving(60, 40, i), 8, i * 40'000'000LL);
    ASSERT_EQ(playback.events.size(), unlabelled.events.size());
    for (std::size_t j = 0; j < playback.events.size(); ++j) {
      EXPECT_EQ(playback.events[j].x, unlabelled.events[j].x);
      EXPECT_EQ(playback.events[j].y, unlabelled.events[j].y);
    }
    const Counts counts(playback.events);
    if (has_labels)
      EXPECT_GT(counts[Cause::light], 0);
    else
      EXPECT_EQ(counts[Cause::unknown], counts.all());
  }
}

TEST(Labels, SurviveAChangeOfTheLeak) {
  Playback playback({60, 40, 8}, DvsSettings{.leak_rate = 2}, labelled);
  Nanoseconds time = 0;
  for (const double rate : {2.0, 40.0, 0.5, 20.0}) {
    playback.set(DvsSettings{.leak_rate = rate});
    for (int i = 0; i < 10; ++i) playback.push(flat(60, 40, 100), 8, time += 40'000'000);
  }
  const Counts counts(playback.events);
  EXPECT_GT(counts.all(), 10'000);
  EXPECT_EQ(counts[Cause::leak], counts.all());
}

}  // namespace
