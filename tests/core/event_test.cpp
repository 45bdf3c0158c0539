// SPDX-License-Identifier: LGPL-2.1-or-later
// Events, their labels, buckets and times; kernels equal their plain reference on every SIMD
// target.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_buckets.hpp"
#include "src/core/fired_pixels.hpp"
#include "src/core/interval_times.hpp"
#include "src/core/label.hpp"
#include "src/core/time_slices.hpp"
#include "src/simulate/simulator.hpp"
#include "tests/core/targets.hpp"

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

TEST(StepTimes, ShareOutTheIntervalAndHaveAMicrosecondEach) {
  const StepTimes shared(33'333'333, 11);
  EXPECT_EQ(shared.count(), 11);
  EXPECT_EQ(shared.microseconds(1), 3030U);
  EXPECT_EQ(shared.microseconds(11), 33'333U);
  for (const auto& [duration, count] : {std::pair{5'000, 5}, {5'999, 5}, {1, 1}})
    EXPECT_EQ(StepTimes(duration, 11).count(), count);
  EXPECT_EQ(StepTimes(1, 11).microseconds(1), 0U);
  const StepTimes steps(5'500, 11);
  for (int j = 2; j <= steps.count(); ++j)
    EXPECT_GT(steps.microseconds(j), steps.microseconds(j - 1));
  const StepTimes longest(max_interval, 256);
  EXPECT_EQ(longest.microseconds(256), 0xffffffffU);
  EXPECT_EQ(longest.microseconds(128), 0x7fffffffU);
}

TEST(Label, LiesInMemoryAsTheMetaHasIt) {
  const Label label{.object_class = 0x0102, .cause = Cause::hot_pixel};
  const unsigned char expected[] = {0x02, 0x01, 4, 0};
  EXPECT_EQ(std::memcmp(&label, expected, sizeof label), 0);
}

/// Events 0 ... count - 1 at these columns, whose labels have the columns as their class.
struct Numbered {
  std::vector<Event> events;
  std::vector<Label> labels;

  explicit Numbered(int count) {
    for (int i = 0; i < count; ++i) {
      events.push_back(Event::at(i, 0, 0, Polarity::on));
      labels.push_back({static_cast<std::uint16_t>(i), Cause::light});
    }
  }
};

TEST(LabelledEvents, AreKeptWithTheirLabels) {
  Numbered numbered(10);
  const LabelledEvents all{numbered.events, numbered.labels};
  const auto kept = all.keep_if([](const Event& event) { return event.x % 3 == 1; });
  ASSERT_EQ(kept.events.size(), 3U);
  ASSERT_EQ(kept.labels.size(), 3U);
  EXPECT_EQ(kept.events.data(), numbered.events.data());
  EXPECT_EQ(kept.labels.data(), numbered.labels.data());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(kept.events[i].x, 3 * i + 1);
    EXPECT_EQ(kept.labels[i].object_class, 3 * i + 1);
  }
}

TEST(LabelledEvents, MayHaveNoLabelsAndMayBeChanged) {
  Numbered numbered(10);
  const LabelledEvents all{numbered.events, {}};
  int calls = 0;
  const auto kept = all.keep_if([&](Event& event) {
    EXPECT_EQ(event.x, calls++);
    event.x = static_cast<std::uint16_t>(event.x + 100);
    return event.x >= 105;
  });
  EXPECT_EQ(calls, 10);
  ASSERT_EQ(kept.events.size(), 5U);
  EXPECT_TRUE(kept.labels.empty());
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(kept.events[i].x, 105 + i);
  EXPECT_EQ(numbered.labels, Numbered(10).labels);
}

/// Pixels of which about one in `rarity` fires, and their events in raster order.
struct Fired {
  explicit Fired(int rarity) {
    std::minstd_rand random(static_cast<unsigned>(rarity));
    pixels.begin(4711);
    for (int y = 0; y < 32768; y += 2339) {
      for (int x = y % 7; x < 1000; x += 64) {
        std::uint64_t fired = 0;
        std::uint64_t on = 0;
        for (int i = 0; i < 64; ++i) {
          const std::uint64_t bit = std::uint64_t{1} << i;
          const bool is_on = random() % 64 < 32;
          if (is_on) on |= bit;
          if (static_cast<int>(random() >> 8) % rarity != 0) continue;
          fired |= bit;
          events.push_back(Event::at(x + i, y, 4711, is_on ? Polarity::on : Polarity::off));
        }
        pixels.add(x, y, fired, on);
      }
    }
  }

  FiredPixels pixels;
  std::vector<Event> events;
};

TEST(FiredPixels, AreWrittenAsTheirEventsOnEveryTarget) {
  targets::for_each([](const char* target) {
    for (const int rarity : {1, 2, 9, 100, 5000}) {
      const Fired fired(rarity);
      ASSERT_EQ(fired.pixels.size(), fired.events.size());
      std::vector<Event> written(fired.events.size() + 1);
      const auto past_the_end = Event::at(1, 2, 3, Polarity::on);
      written.back() = past_the_end;
      fired.pixels.write_to(written.data());
      EXPECT_EQ(written.back(), past_the_end) << target << ", one in " << rarity;
      written.pop_back();
      EXPECT_EQ(written, fired.events) << target << ", one in " << rarity;

      std::vector<Event> visited;
      fired.pixels.visit([&](std::span<const Event> events) {
        visited.insert(visited.end(), events.begin(), events.end());
      });
      EXPECT_EQ(visited, fired.events) << target << ", one in " << rarity;
    }
  });
}

TEST(FiredPixels, BeginAgain) {
  Fired fired(3);
  fired.pixels.begin(1);
  EXPECT_EQ(fired.pixels.size(), 0U);
  fired.pixels.write_to(nullptr);
  fired.pixels.add(65530, 32767, 0b100001, 0b100000);
  EXPECT_EQ(fired.pixels.on_size(), 1U);
  std::vector<Event> events(2);
  fired.pixels.write_to(events.data());
  EXPECT_EQ(events, (std::vector{Event::at(65530, 32767, 1, Polarity::off),
                                 Event::at(65535, 32767, 1, Polarity::on)}));
}

constexpr Microseconds start = (Microseconds{1} << 40) + 12'345;

std::vector<AbsoluteEvent> random_events(std::size_t count) {
  std::mt19937 random(static_cast<unsigned>(count));
  std::vector<AbsoluteEvent> events;
  auto t = start;
  for (std::size_t i = 0; i < count; ++i, t += random() % 3)
    events.push_back(
        {t, static_cast<std::uint16_t>(random()), static_cast<std::uint16_t>(random())});
  return events;
}

/// An element past the end, which nothing may change, is in the result too.
std::vector<Event> expected(std::span<const AbsoluteEvent> events) {
  std::vector<Event> out;
  for (const auto& event : events)
    out.push_back({static_cast<std::uint32_t>(event.t - start), event.x, event.y_p});
  out.push_back({});
  return out;
}

TEST(IntervalTimes, EqualThePlainReferenceAtEverySize) {
  targets::for_each([](const char* target) {
    for (std::size_t count = 0; count < 70; ++count) {
      const auto events = random_events(count);
      std::vector<Event> out(count + 1);
      EXPECT_TRUE(to_interval_times(start, start, events, out.data())) << target << ' ' << count;
      EXPECT_EQ(out, expected(events)) << target << ' ' << count;
    }
  });
}

TEST(IntervalTimes, NoticeEveryFall) {
  targets::for_each([](const char* target) {
    for (std::size_t count = 1; count < 40; ++count)
      for (std::size_t late = 0; late < count; ++late) {
        auto events = random_events(count);
        const auto before = late == 0 ? start : events[late - 1].t;
        for (std::size_t i = late; i < count; ++i) events[i].t = before - 1;
        std::vector<Event> out(count + 1);
        EXPECT_FALSE(to_interval_times(start, start, events, out.data()))
            << target << ' ' << count << ' ' << late;
        EXPECT_EQ(out, expected(events)) << target << ' ' << count << ' ' << late;
      }
  });
}

TEST(IntervalTimes, AreComparedOverTheirWholeRange) {
  constexpr auto far = Microseconds{3} << 61;
  targets::for_each([](const char* target) {
    for (std::size_t count = 3; count < 40; ++count) {
      auto events = random_events(count);
      events[count - 2].t = far;
      events[count - 1].t = -far;  // further back than 64 bits can tell
      std::vector<Event> out(count);
      EXPECT_FALSE(to_interval_times(start, start, events, out.data())) << target << ' ' << count;
    }
  });
}

}  // namespace
