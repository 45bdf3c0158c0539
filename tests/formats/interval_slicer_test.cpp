// SPDX-License-Identifier: LGPL-2.1-or-later
// Events cut into intervals: what is in them, in which order, and what is dropped.
#include "src/formats/interval_slicer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <tuple>

#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;

constexpr Microseconds length = 10'000;

StampedEvent at(Microseconds t, int x = 1, int y = 2, Polarity polarity = Polarity::on) {
  return StampedEvent::at(x, y, t, polarity);
}

struct Cut {
  Microseconds start;
  Microseconds duration;
  std::vector<Event> events;
};

void take_whole(IntervalSlicer& slicer, std::vector<Cut>& cuts) {
  while (const auto interval = slicer.next())
    cuts.push_back(
        {interval->start, interval->duration, {interval->events.begin(), interval->events.end()}});
}

std::vector<Cut> slice(IntervalSlicer& slicer, std::span<const StampedEvent> events,
                       std::size_t piece = 7) {
  std::vector<Cut> cuts;
  while (!events.empty()) {
    const auto few = events.first(std::min(piece, events.size()));
    events = events.subspan(few.size());
    slicer.push(few);
    take_whole(slicer, cuts);
  }
  slicer.finish();
  take_whole(slicer, cuts);
  return cuts;
}

std::vector<StampedEvent> joined(const std::vector<Cut>& cuts) {
  std::vector<StampedEvent> events;
  for (const auto& cut : cuts)
    for (const auto& event : cut.events)
      events.push_back({cut.start + event.t, event.x, event.y_p});
  return events;
}

TEST(IntervalSlicer, BeginsWithTheFirstEventAndEndsAfterTheLast) {
  IntervalSlicer slicer(length);
  const auto cuts = slice(slicer, std::vector{at(5'000), at(14'999), at(15'000), at(16'000)});
  ASSERT_EQ(cuts.size(), 2U);
  EXPECT_EQ(cuts[0].start, 5'000);
  EXPECT_EQ(cuts[0].duration, length);
  EXPECT_EQ(cuts[0].events,
            (std::vector{Event::at(1, 2, 0, Polarity::on), Event::at(1, 2, 9'999, Polarity::on)}));
  EXPECT_EQ(cuts[1].start, 15'000);
  EXPECT_EQ(cuts[1].duration, 1'001);
  EXPECT_EQ(cuts[1].events.size(), 2U);
  EXPECT_EQ(slicer.first(), 5'000);
  EXPECT_EQ(slicer.latest(), 16'000);
}

TEST(IntervalSlicer, MakesHardlyMoreThanOneGapOfASilence) {
  constexpr Microseconds year = Microseconds{365} * 86'400 * 1'000'000;
  IntervalSlicer slicer(length);
  const auto cuts = slice(slicer, std::vector{at(0), at(year), at(year + 1)});
  // The last piece of it waits for what may be out of order.
  ASSERT_EQ(cuts.size(), 4U);
  EXPECT_EQ(cuts[1].start, length);
  EXPECT_TRUE(cuts[1].events.empty());
  EXPECT_EQ(cuts[2].start, cuts[1].start + cuts[1].duration);
  EXPECT_TRUE(cuts[2].events.empty());
  EXPECT_LE(year - cuts[3].start, length);
  EXPECT_EQ(cuts[3].events.size(), 2U);
}

TEST(IntervalSlicer, NeitherLosesNorMovesSortedEvents) {
  std::mt19937_64 random(1);
  for (const std::size_t piece : {1UL, 100UL, 5000UL, 1UL << 20}) {
    auto events = recordings::random_events(random, {640, 480}, 50'000, 300'000);
    IntervalSlicer slicer(length);
    const auto cuts = slice(slicer, events, piece);
    const auto in_order = [](const StampedEvent& e) { return std::tuple(e.t, e.y(), e.x); };
    std::ranges::stable_sort(events, {}, in_order);
    const auto repeated = std::ranges::unique(events, {}, in_order);
    EXPECT_EQ(slicer.dropped().repeated, repeated.size());
    events.erase(repeated.begin(), repeated.end());
    EXPECT_EQ(joined(cuts), events);
    EXPECT_EQ(slicer.dropped().late, 0U);
    EXPECT_EQ(slicer.dropped().stray, 0U);
    for (std::size_t i = 1; i < cuts.size(); ++i)
      ASSERT_EQ(cuts[i].start, cuts[i - 1].start + cuts[i - 1].duration);
    for (const auto& cut : cuts) {
      if (!cut.events.empty()) {
        ASSERT_LE(cut.duration, length);
      }
      for (const auto& event : cut.events) ASSERT_LT(event.t, cut.duration);
    }
  }
}

TEST(IntervalSlicer, SortsWhatIsSlightlyOutOfOrder) {
  std::vector<StampedEvent> events;
  for (Microseconds t = 0; t < 100'000; t += 100) events.push_back(at(t));
  auto disordered = events;
  std::mt19937 random(2);
  for (std::size_t i = 40; i + 40 < disordered.size(); i += 40)
    std::shuffle(disordered.begin() + static_cast<std::ptrdiff_t>(i),
                 disordered.begin() + static_cast<std::ptrdiff_t>(i + 40), random);
  IntervalSlicer slicer(length);
  EXPECT_EQ(joined(slice(slicer, disordered)), events);
  EXPECT_EQ(slicer.dropped().late, 0U);
}

TEST(IntervalSlicer, DropsWhatComesTooLate) {
  IntervalSlicer slicer(length);
  std::vector<StampedEvent> events;
  for (Microseconds t = 0; t < 50'000; t += 100) events.push_back(at(t));
  events.push_back(at(100, 3));
  const auto cuts = slice(slicer, events);
  EXPECT_EQ(slicer.dropped().late, 1U);
  EXPECT_EQ(joined(cuts).size(), events.size() - 1);
}

TEST(IntervalSlicer, IgnoresAClockThatJumpsAheadAndComesBack) {
  std::vector<StampedEvent> events;
  for (Microseconds t = 0; t < 100'000; t += 100) {
    // As a bit of a high time that flips: for some hundred microseconds, now and then.
    const bool flipped = t % 20'000 < 500;
    events.push_back(at(flipped ? t + 8'388'608 : t));
  }
  IntervalSlicer slicer(length);
  const auto cuts = slice(slicer, events);
  EXPECT_EQ(slicer.dropped().stray, 25U);
  EXPECT_EQ(joined(cuts).size(), events.size() - 25);
  EXPECT_EQ(slicer.first(), 500);
  EXPECT_EQ(slicer.latest(), 99'900);
}

TEST(IntervalSlicer, RefusesImpossibleTimes) {
  constexpr auto most = std::numeric_limits<Microseconds>::max();
  constexpr auto least = std::numeric_limits<Microseconds>::min();
  IntervalSlicer slicer(length);
  const auto cuts = slice(slicer, std::vector{at(most), at(0), at(least), at(1), at(most - 1)});
  EXPECT_EQ(slicer.dropped().stray, 3U);
  EXPECT_EQ(joined(cuts).size(), 2U);
  IntervalSlicer longest(length);
  EXPECT_EQ(joined(slice(longest, std::vector{at(-IntervalSlicer::longest_time),
                                              at(IntervalSlicer::longest_time)}))
                .size(),
            2U);
}

TEST(IntervalSlicer, BoundsTheEventsOfAnInterval) {
  IntervalSlicer slicer(length);
  // More than a million pixels can fire within one microsecond.
  std::vector<StampedEvent> events(1 << 16, at(7));
  std::vector<Cut> cuts;
  std::size_t largest = 0;
  slicer.push(std::vector{at(0)});
  for (int i = 0; i < 100; ++i) {
    slicer.push(events);
    while (const auto interval = slicer.next()) {
      EXPECT_LE(interval->start + interval->duration, 8);
      largest = std::max(largest, interval->events.size());
    }
  }
  slicer.finish();
  take_whole(slicer, cuts);
  EXPECT_GT(slicer.dropped().late, 0U);      // once the microsecond is handed out
  EXPECT_GT(slicer.dropped().repeated, 0U);  // they are all of one pixel
}

TEST(IntervalSlicer, LeavesOutWhatIsBeforeItsStart) {
  std::vector<StampedEvent> events;
  for (Microseconds t = 0; t < 100'000; t += 100) events.push_back(at(t));
  IntervalSlicer slicer(length, 42'000);
  const auto cuts = slice(slicer, events);
  ASSERT_FALSE(cuts.empty());
  EXPECT_EQ(cuts.front().start, 42'000);
  EXPECT_EQ(joined(cuts).size(), 580U);
  EXPECT_EQ(slicer.dropped().late, 0U);
}

TEST(IntervalSlicer, HandsOutWhatIsReachedAtOnce) {
  IntervalSlicer slicer(length);
  slicer.push(std::vector{at(0), at(3'000)});
  EXPECT_FALSE(slicer.next());
  slicer.reach(9'999);
  EXPECT_FALSE(slicer.next());
  slicer.reach(10'000);
  const auto interval = slicer.next();
  ASSERT_TRUE(interval);
  EXPECT_EQ(interval->events.size(), 2U);
  slicer.reach(35'000);
  const auto silence = slicer.next();
  ASSERT_TRUE(silence);
  EXPECT_TRUE(silence->events.empty());
  EXPECT_EQ(silence->duration, 20'000);
}

}  // namespace
