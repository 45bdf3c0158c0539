// SPDX-License-Identifier: LGPL-2.1-or-later
// Cutting events into intervals: content, order and dropped events.
#include "src/formats/chunker.hpp"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <random>

#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Events;

constexpr Microseconds length = 10'000;

AbsoluteEvent at(Microseconds t, int x = 1, int y = 2, Polarity polarity = Polarity::on) {
  return AbsoluteEvent::at(x, y, t, polarity);
}

Events steady(Microseconds start, Microseconds stop, Microseconds step = 100) {
  Events events;
  for (auto t = start; t < stop; t += step) events.push_back(at(t));
  return events;
}

struct Cut {
  Microseconds start;
  Microseconds duration;
  std::vector<Event> events;
};

void take_whole(Chunker& chunker, std::vector<Cut>& cuts) {
  while (const auto interval = chunker.next())
    cuts.push_back(
        {interval->start, interval->duration, {interval->events.begin(), interval->events.end()}});
}

std::vector<Cut> slice(Chunker& chunker, std::span<const AbsoluteEvent> events,
                       std::size_t piece = 7) {
  std::vector<Cut> cuts;
  while (!events.empty()) {
    const auto few = events.first(std::min(piece, events.size()));
    events = events.subspan(few.size());
    chunker.push(few);
    take_whole(chunker, cuts);
  }
  chunker.finish();
  take_whole(chunker, cuts);
  return cuts;
}

Events joined(const std::vector<Cut>& cuts) {
  Events events;
  for (const auto& cut : cuts)
    for (const auto& event : cut.events)
      events.push_back({cut.start + event.t, event.x, event.y_p});
  return events;
}

TEST(Chunker, BeginsWithTheFirstEventAndEndsAfterTheLast) {
  Chunker chunker(length);
  const auto cuts = slice(chunker, std::vector{at(5'000), at(14'999), at(15'000), at(16'000)});
  ASSERT_EQ(cuts.size(), 2U);
  EXPECT_EQ(cuts[0].start, 5'000);
  EXPECT_EQ(cuts[0].duration, length);
  EXPECT_EQ(cuts[0].events,
            (std::vector{Event::at(1, 2, 0, Polarity::on), Event::at(1, 2, 9'999, Polarity::on)}));
  EXPECT_EQ(cuts[1].start, 15'000);
  EXPECT_EQ(cuts[1].duration, 1'001);
  EXPECT_EQ(cuts[1].events.size(), 2U);
  EXPECT_EQ(chunker.first(), 5'000);
  EXPECT_EQ(chunker.latest(), 16'000);
}

TEST(Chunker, MakesOneGapOfASilence) {
  constexpr Microseconds year = Microseconds{365} * 86'400 * 1'000'000;
  Chunker chunker(length);
  const auto cuts = slice(chunker, std::vector{at(0), at(year), at(year + 1)});
  ASSERT_EQ(cuts.size(), 3U);
  EXPECT_EQ(cuts[1].start, length);
  EXPECT_TRUE(cuts[1].events.empty());
  EXPECT_EQ(cuts[2].start, cuts[1].start + cuts[1].duration);
  EXPECT_LE(year - cuts[2].start, length);
  EXPECT_EQ(cuts[2].events.size(), 2U);
}

TEST(Chunker, NeitherLosesNorMovesSortedEvents) {
  std::mt19937_64 random(1);
  for (const std::size_t piece : {1UL, 100UL, 5000UL, 1UL << 20}) {
    const auto events = recordings::random_events(random, {640, 480}, 50'000, 300'000);
    Chunker chunker(length);
    const auto cuts = slice(chunker, events, piece);
    EXPECT_EQ(joined(cuts), events);
    EXPECT_EQ(chunker.dropped().late, 0U);
    EXPECT_EQ(chunker.dropped().stray, 0U);
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

TEST(Chunker, SortsWhatIsSlightlyOutOfOrder) {
  const auto events = steady(0, 100'000);
  auto disordered = events;
  std::mt19937 random(2);
  for (std::size_t i = 40; i + 40 < disordered.size(); i += 40)
    std::shuffle(disordered.begin() + static_cast<std::ptrdiff_t>(i),
                 disordered.begin() + static_cast<std::ptrdiff_t>(i + 40), random);
  Chunker chunker(length);
  EXPECT_EQ(joined(slice(chunker, disordered)), events);
  EXPECT_EQ(chunker.dropped().late, 0U);
}

TEST(Chunker, KeepsEveryEventOfATimeInTheirOwnOrder) {
  // Against raster order, and the same pixel more than once; some come out of order.
  const std::vector events{at(20, 9, 9), at(20, 1, 2, Polarity::off), at(20, 1, 2, Polarity::on),
                           at(10, 7, 7), at(20, 1, 2, Polarity::on),  at(10, 3, 3),
                           at(20, 0, 0)};
  const std::vector sorted{events[3], events[5], events[0], events[1],
                           events[2], events[4], events[6]};
  for (const std::size_t piece : {1UL, 2UL, 7UL}) {
    Chunker chunker(length);
    EXPECT_EQ(joined(slice(chunker, events, piece)), sorted);
  }
}

TEST(Chunker, DropsTheSameEventsHoweverTheyAreDivided) {
  std::mt19937_64 random(5);
  auto events = recordings::random_events(random, {640, 480}, 2'000, 30'000);
  std::shuffle(events.begin() + 1'000, events.end(), random);
  Chunker whole(length);
  const auto expected = joined(slice(whole, events, events.size()));
  ASSERT_TRUE(whole.disorder());
  EXPECT_GT(whole.disorder()->row, 1'000U);
  EXPECT_LT(whole.disorder()->row, 1'100U);
  for (const std::size_t piece : {1UL, 7UL, 300UL}) {
    Chunker chunker(length);
    EXPECT_EQ(joined(slice(chunker, events, piece)), expected);
    EXPECT_EQ(chunker.dropped().late, whole.dropped().late);
    EXPECT_EQ(chunker.disorder()->row, whole.disorder()->row);
    EXPECT_EQ(chunker.disorder()->rows, whole.disorder()->rows);
  }
}

TEST(Chunker, TellsDisorderFromOneEventInAHundredOn) {
  for (const int period : {50, 90, 120, 1000}) {
    Events events;
    for (int i = 1; i <= 30'000; ++i) events.push_back(at(i % period == 0 ? 0 : 100 * i));
    Chunker chunker(length);
    slice(chunker, events);
    EXPECT_EQ(chunker.disorder().has_value(), period < 100) << period;
  }
}

/// 6000 events in 200 ms, with a time that is wrong in one bit.
TEST(Chunker, DropsOneEventOfAWrongTime) {
  for (const Microseconds start : {Microseconds{0}, Microseconds{1'700'000'000'123'456}}) {
    for (const std::size_t wrong : {0, 1, 2, 3, 50, 299, 300, 301, 3000, 5998}) {
      for (const int bit : {20, 21, 30, 40, 50}) {
        auto events = steady(start, start + 198'000, 33);
        events[wrong].t ^= Microseconds{1} << bit;
        Chunker chunker(length);
        const auto cuts = slice(chunker, events);
        events.erase(events.begin() + static_cast<std::ptrdiff_t>(wrong));
        EXPECT_TRUE(joined(cuts) == events) << "bit " << bit << " of event " << wrong;
        EXPECT_EQ(chunker.dropped().late + chunker.dropped().stray, 1U);
      }
    }
  }
}

/// Some wrong times in a row, also between events that are far apart.
TEST(Chunker, DropsFewEventsOfWrongTimes) {
  for (const Microseconds step : {100, 30'000}) {
    const std::size_t count = step == 100 ? 5 : 1;
    for (const std::size_t wrong : {0, 1, 2, 20, 200}) {
      auto events = steady(0, 1000 * step, step);
      for (std::size_t i = wrong; i < wrong + count; ++i) events[i].t += Microseconds{1} << 32;
      Chunker chunker(length);
      EXPECT_EQ(joined(slice(chunker, events)).size(), 1000 - count)
          << "step " << step << ", from event " << wrong;
    }
  }
}

TEST(Chunker, KeepsPausesBetweenFewEvents) {
  constexpr Microseconds day = 86'400'000'000;
  const std::vector<std::vector<Microseconds>> files = {
      {100, 200, 1300, 1'000'400},
      {0, day, 2 * day, 2 * day + 1, 3 * day},
      {0, 100, day, day + 100},
      {0, day, day + 100},
      {5},
      {5, 5 + day},
  };
  for (const auto& times : files) {
    Events events;
    for (const auto t : times) events.push_back(at(t));
    for (const std::size_t piece : {1, 2, 7}) {
      Chunker chunker(length);
      EXPECT_EQ(joined(slice(chunker, events, piece)), events);
    }
  }
}

TEST(Chunker, RefusesImpossibleTimes) {
  constexpr auto max = std::numeric_limits<Microseconds>::max();
  constexpr auto min = std::numeric_limits<Microseconds>::min();
  Chunker chunker(length);
  const auto cuts = slice(chunker, std::vector{at(max), at(0), at(min), at(1), at(max - 1)});
  EXPECT_EQ(chunker.dropped().stray, 3U);
  EXPECT_EQ(joined(cuts).size(), 2U);
  Chunker longest(length);
  EXPECT_EQ(
      joined(slice(longest, std::vector{at(-Chunker::max_time), at(Chunker::max_time)})).size(),
      2U);
}

/// Expects intervals of limited size that have `count` events, event i at `time_of(i)`, in order.
template <class TimeOf>
void expect_bounded(std::size_t count, std::size_t at_once, bool is_labelled,
                    const TimeOf& time_of) {
  const auto class_of = [](std::size_t i) { return static_cast<std::uint16_t>(i * 7); };
  Chunker chunker(length);
  chunker.keep_labels(is_labelled);
  std::size_t taken = 0;
  std::size_t misplaced = 0;
  Microseconds reached = 0;
  const auto take = [&] {
    while (const auto interval = chunker.next()) {
      ASSERT_EQ(interval->start, reached);
      reached += interval->duration;
      ASSERT_LE(interval->events.size(), Chunker::max_events);
      ASSERT_EQ(interval->labels.size(), is_labelled ? interval->events.size() : 0);
      for (std::size_t i = 0; i < interval->events.size(); ++i, ++taken) {
        const auto& event = interval->events[i];
        misplaced += interval->start + event.t != time_of(taken) ||
                     event.x != static_cast<std::uint16_t>(taken) ||
                     (is_labelled && interval->labels[i].object_class != class_of(taken));
      }
    }
  };
  Events events;
  for (std::size_t i = 0; i < count; ++i) {
    AbsoluteEvent event{time_of(i), static_cast<std::uint16_t>(i), 0};
    event.object_class = class_of(i);
    events.push_back(event);
    if (events.size() < at_once && i + 1 < count) continue;
    chunker.push(events);
    events.clear();
    take();
  }
  chunker.finish();
  take();
  EXPECT_EQ(taken, count);
  EXPECT_EQ(misplaced, 0U);
  EXPECT_EQ(reached, time_of(count - 1) + 1);
  EXPECT_EQ(chunker.dropped().late, 0U);
}

TEST(Chunker, BoundsTheEventsOfAnInterval) {
  // More than a million pixels can fire within one microsecond, and some clocks stand still.
  constexpr std::size_t count = 40 << 16;
  for (const Microseconds start : {0, 7})
    for (const bool is_labelled : {false, true})
      expect_bounded(count + 2, 1 << 16, is_labelled, [&](std::size_t i) -> Microseconds {
        return i == 0 ? 0 : i <= count ? start : 20'000;
      });
  // An overfull interval.
  constexpr std::size_t per_time = 300;
  expect_bounded(per_time * 2 * length, per_time, false,
                 [](std::size_t i) { return static_cast<Microseconds>(i / per_time); });
}

TEST(Chunker, NeedsNoMoreMemoryOverTime) {
  const auto heap = [] {
    const auto info = mallinfo2();
    return info.uordblks + info.hblkhd;
  };
  const std::vector events(1 << 16, at(0));
  for (const Microseconds step : {1, 300}) {  // cut in the middle of an interval, and between
    SCOPED_TRACE(step);
    Chunker chunker(length);
    auto later = events;
    const auto run = [&](int blocks) {
      for (int i = 0; i < blocks; ++i) {
        for (auto& event : later) event.t += step;
        chunker.push(later);
        while (chunker.next()) continue;
      }
    };
    run(100);
    const auto after_some = heap();
    run(200);
    EXPECT_LE(heap(), after_some + (std::size_t{1} << 26));
  }
}

/// Of a clock that starts over.
TEST(Chunker, CountsWhatIsBeforeTheOrigin) {
  auto events = steady(50'000, 150'000);
  std::ranges::copy(steady(0, 70'000), std::back_inserter(events));
  for (const Microseconds start : {50'000, 100'000}) {
    Chunker chunker(length, start, 50'000);
    const auto cuts = slice(chunker, events);
    EXPECT_EQ(cuts.at(0).start, start);
    EXPECT_EQ(joined(cuts).size(), static_cast<std::size_t>(150'000 - start) / 100);
    // Before the start of a seek, events from the origin on are ignored.
    EXPECT_EQ(chunker.dropped().late, start == 50'000 ? 700U : 500U);
  }
}

TEST(Chunker, HandsOutWhatIsReachedAtOnce) {
  Chunker chunker(length);
  chunker.push(std::vector{at(0), at(3'000)});
  EXPECT_FALSE(chunker.next());
  chunker.advance_to(9'999);
  EXPECT_FALSE(chunker.next());
  chunker.advance_to(10'000);
  const auto interval = chunker.next();
  ASSERT_TRUE(interval);
  EXPECT_EQ(interval->events.size(), 2U);
  chunker.advance_to(35'000);
  const auto silence = chunker.next();
  ASSERT_TRUE(silence);
  EXPECT_TRUE(silence->events.empty());
  EXPECT_EQ(silence->duration, 20'000);
}

TEST(Chunker, HandsOutWhatWaitsInAPause) {
  const std::vector before{at(0), at(3'000), at(3'000, 5)};
  const std::vector after{at(3'000, 7), at(3'001), at(40'000), at(50'000), at(60'000)};
  Chunker chunker(length);
  chunker.push(before);
  std::vector<Cut> cuts;
  take_whole(chunker, cuts);
  EXPECT_TRUE(cuts.empty());
  chunker.pause(1'000'000);
  take_whole(chunker, cuts);
  EXPECT_EQ(joined(cuts), before);
  chunker.push(after);
  take_whole(chunker, cuts);
  EXPECT_LT(joined(cuts).size(), before.size() + after.size());
  chunker.finish();
  take_whole(chunker, cuts);
  auto all = before;
  all.insert(all.end(), after.begin(), after.end());
  EXPECT_EQ(joined(cuts), all);
  EXPECT_EQ(chunker.dropped().late, 0U);
}

TEST(Chunker, KeepsLabelsWithTheirEvents) {
  // Out of order, and so many that intervals are cut in two.
  std::mt19937 random(5);
  Events events;
  constexpr std::size_t count = Chunker::max_events + 100'000;
  for (std::size_t i = 0; i < count; ++i) {
    auto& event = events.emplace_back(
        at(static_cast<Microseconds>(i / 600) + static_cast<Microseconds>(random() % 500)));
    event.x = static_cast<std::uint16_t>(random() % 1000);
    event.object_class = static_cast<std::uint16_t>(event.x + 7);
    event.cause = Cause::leak;
  }
  Chunker chunker(length);
  chunker.keep_labels(true);
  chunker.push(events);
  chunker.finish();
  std::size_t labelled = 0;
  while (const auto interval = chunker.next()) {
    ASSERT_EQ(interval->labels.size(), interval->events.size());
    const auto of_event = [](const Event& event) {
      return Label{.object_class = static_cast<std::uint16_t>(event.x + 7), .cause = Cause::leak};
    };
    ASSERT_TRUE(std::ranges::equal(interval->labels, interval->events, {}, {}, of_event));
    labelled += interval->labels.size();
  }
  EXPECT_EQ(labelled, count);
}

}  // namespace
