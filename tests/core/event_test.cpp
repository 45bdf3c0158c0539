// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/event.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <span>
#include <tuple>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/time_slices.hpp"
#include "src/simulate/simulator.hpp"

namespace {

using namespace eventcamera;

TEST(Event, LiesInMemoryAsXytpHasIt) {
  const auto event = Event::at(0x0102, 0x0304, 0x05060708, Polarity::on);
  const unsigned char expected[] = {0x08, 0x07, 0x06, 0x05, 0x02, 0x01, 0x04, 0x83};
  EXPECT_EQ(std::memcmp(&event, expected, sizeof event), 0);
  EXPECT_EQ(event.y(), 0x0304);
  EXPECT_EQ(event.polarity(), Polarity::on);
  EXPECT_EQ(Event::at(0, 32767, 0, Polarity::off).y_p, 0x7fff);
}

TEST(StepBuckets, ReadStepByStepAndBandByBand) {
  StepBuckets buckets;
  buckets.reset(2, 3);
  buckets.bucket(2, 0).push_back(Event::at(3, 0, 2, Polarity::on));
  buckets.bucket(1, 2).push_back(Event::at(2, 0, 1, Polarity::on));
  buckets.bucket(1, 0).push_back(Event::at(1, 0, 1, Polarity::off));
  ASSERT_EQ(buckets.size(), 3U);
  Event events[3];
  ThreadPool threads;
  buckets.write_to(events, threads);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(events[i].x, i + 1);
  buckets.reset(1, 1);
  EXPECT_EQ(buckets.size(), 0U);
  int visits = 0;
  buckets.visit_band(0, [&](std::span<const Event> some) { visits += some.empty() ? 1 : 100; });
  EXPECT_EQ(visits, 1);
}

TEST(StepBuckets, AreWrittenOnceByAnyNumberOfThreads) {
  StepBuckets buckets;
  buckets.reset(3, 4);
  std::vector<Event> expected;
  std::mt19937_64 random;
  for (int step = 1; step <= 3; ++step) {
    for (int band = 0; band < 4; ++band) {
      // Lists and pixels, in turn.
      for (int i = 0; band % 2 == 1 && i < 5000 * step; ++i) {
        expected.push_back(Event::at(i, 100 * band, step, Polarity::off));
        buckets.bucket(step, band).push_back(expected.back());
      }
      auto& pixels = buckets.pixels(step, band);
      pixels.begin(static_cast<std::uint32_t>(step));
      for (int i = 0; band % 2 == 0 && i < 300 * ((step + band) % 3); ++i) {
        const int y = 100 * band + i / 10;
        const int x = 64 * (i % 10);
        const std::uint64_t fired = random();
        const std::uint64_t on = random();
        pixels.add(x, y, fired, on);
        for (int bit = 0; bit < 64; ++bit)
          if ((fired >> bit & 1) != 0)
            expected.push_back(Event::at(x + bit, y, static_cast<std::uint32_t>(step),
                                         (on >> bit & 1) != 0 ? Polarity::on : Polarity::off));
      }
    }
  }
  ASSERT_EQ(buckets.size(), expected.size());
  ThreadPool threads;
  for (const int max_threads : {1, 2, 0}) {
    threads.set_threads(max_threads);
    std::vector<Event> events(expected.size());
    buckets.write_to(events.data(), threads);
    EXPECT_TRUE(events == expected) << max_threads << " threads";
  }
  buckets.reset(1, 1);
  buckets.write_to(nullptr, threads);
}

TEST(TimeSlices, AreSortedByAnyNumberOfThreads) {
  constexpr int bands = 3;
  constexpr int rows = 5;  // of a band
  constexpr int width = 8;
  std::minstd_rand random;
  TimeSlices slices;
  ThreadPool threads;
  for (const std::uint32_t duration : {0U, 1U, 63U, 64U, 1000U, 33'333U, 3'000'000U, 0xffffffffU}) {
    for (const int count : {0, 1, 10, 1000, 100'000}) {
      slices.reset(duration, bands);
      EXPECT_EQ(slices.size(), 0U);
      std::vector<Event> expected;
      std::array<std::vector<Event>, bands> added;
      std::uniform_int_distribution<std::uint32_t> time(0, duration);
      for (int i = 0; i < count; ++i) {
        const int band = static_cast<int>(random() % bands);
        const int y = band * rows + static_cast<int>(random() % rows);
        expected.push_back(
            Event::at(static_cast<int>(random() % width), y, time(random), Polarity::on));
        added.at(static_cast<std::size_t>(band)).push_back(expected.back());
      }
      for (int band = 0; band < bands; ++band)
        slices.add(band, added.at(static_cast<std::size_t>(band)));
      ASSERT_EQ(slices.size(), expected.size());
      std::ranges::sort(expected, {},
                        [](const Event& event) { return std::tuple(event.t, event.y(), event.x); });
      for (const int max_threads : {1, 2, 0}) {
        threads.set_threads(max_threads);
        std::vector<Event> events(expected.size());
        slices.write_to(events.data(), threads);
        EXPECT_TRUE(events == expected) << count << " in " << duration << ", " << max_threads;
      }
    }
  }
}

TEST(StepTimes, ShareOutTheInterval) {
  const StepTimes steps(33'333'333, 11);
  EXPECT_EQ(steps.count(), 11);
  EXPECT_EQ(steps.microseconds(1), 3030U);
  EXPECT_EQ(steps.microseconds(11), 33'333U);
}

TEST(StepTimes, HaveAMicrosecondEach) {
  EXPECT_EQ(StepTimes(5'000, 11).count(), 5);
  EXPECT_EQ(StepTimes(5'999, 11).count(), 5);
  EXPECT_EQ(StepTimes(1, 11).count(), 1);
  EXPECT_EQ(StepTimes(1, 11).microseconds(1), 0U);
  const StepTimes steps(5'500, 11);
  for (int j = 2; j <= steps.count(); ++j)
    EXPECT_GT(steps.microseconds(j), steps.microseconds(j - 1));
}

TEST(StepTimes, ReachOverTheLongestInterval) {
  const StepTimes steps(max_interval, 256);
  EXPECT_EQ(steps.microseconds(256), 0xffffffffU);
  EXPECT_EQ(steps.microseconds(128), 0x7fffffffU);
}

}  // namespace
