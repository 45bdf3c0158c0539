// SPDX-License-Identifier: LGPL-2.1-or-later
// Windows by time, by count and of intervals.
#include "src/tensor/window_queue.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace {

using namespace eventcamera;

constexpr Nanoseconds ms = 1'000'000;

/// A window by the columns of its events, which tests use as their numbers.
struct Found {
  Nanoseconds start;
  Nanoseconds end;
  std::vector<int> columns;

  friend bool operator==(const Found&, const Found&) = default;
};

void PrintTo(const Found& found, std::ostream* out) {
  *out << found.start << ".." << found.end << ":";
  for (const int column : found.columns) *out << " " << column;
}

Found found_of(const WindowQueue::Window& window) {
  Found found{window.start, window.end, {}};
  for (const auto& event : window.events) found.columns.push_back(event.x);
  return found;
}

class Windows : public testing::Test {
 protected:
  explicit Windows(const WindowSettings& settings = {}) : queue(100, 1, settings) {}

  /// Adds an interval with events at these times, and takes the windows that it completes.
  WindowQueue::Added add(Nanoseconds start, Nanoseconds end,
                         const std::vector<Microseconds>& times = {}) {
    std::vector<Event> events;
    for (const auto time : times)
      events.push_back(Event::at(next_column++, 0, static_cast<std::uint32_t>(time - start / 1000),
                                 Polarity::on));
    const auto added = queue.add(events, start / 1000, start, end);
    while (const auto window = queue.next()) found.push_back(found_of(*window));
    return added;
  }
  void finish() {
    if (const auto window = queue.finish()) found.push_back(found_of(*window));
  }

  WindowQueue queue;
  int next_column = 0;
  std::vector<Found> found;
};

TEST_F(Windows, AreIntervals) {
  add(0, 10 * ms, {0, 5, 10'000});
  add(10 * ms, 20 * ms);
  add(20 * ms + 1, 30 * ms, {20'000});
  finish();
  EXPECT_EQ(found,
            (std::vector<Found>{
                {0, 10 * ms, {0, 1, 2}}, {10 * ms, 20 * ms, {}}, {20 * ms + 1, 30 * ms, {3}}}));
}

struct OverlappingIntervals : Windows {
  OverlappingIntervals() : Windows({.intervals = 3, .overlap = 0.67}) {}
};

TEST_F(OverlappingIntervals, AdvanceByOne) {
  for (int i = 0; i < 5; ++i) add(i * ms, (i + 1) * ms, {i * 1000});
  finish();
  EXPECT_EQ(found,
            (std::vector<Found>{
                {0, 3 * ms, {0, 1, 2}}, {1 * ms, 4 * ms, {1, 2, 3}}, {2 * ms, 5 * ms, {2, 3, 4}}}));
}

struct PairsOfIntervals : Windows {
  PairsOfIntervals() : Windows({.intervals = 2}) {}
};

TEST_F(PairsOfIntervals, EndWithAShortOne) {
  for (int i = 0; i < 3; ++i) add(i * ms, (i + 1) * ms, {i * 1000});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{0, 2 * ms, {0, 1}}, {2 * ms, 3 * ms, {2}}}));
}

/// An interval that steps back begins where the last one ended, and so do its events.
TEST_F(PairsOfIntervals, NeverGoBack) {
  queue.add({}, 0, 2 * ms, 3 * ms);
  queue.add(std::vector{Event::at(0, 0, 0, Polarity::on)}, 1000, 1 * ms, 2 * ms);
  const auto window = queue.next();
  EXPECT_EQ(found_of(*window), (Found{2 * ms, 3 * ms, {0}}));
  EXPECT_EQ(window->events.front().t, 3000);
}

struct ByTime : Windows {
  ByTime() : Windows({.duration = 10 * ms}) {}
};

/// They do not depend on how the events come; a window excludes its end.
TEST_F(ByTime, PartitionTheStream) {
  add(3 * ms, 14 * ms, {3'000, 12'999, 13'000});
  add(14 * ms, 40 * ms, {32'999});
  add(40 * ms, 45 * ms, {44'000});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{3 * ms, 13 * ms, {0, 1}},
                                       {13 * ms, 23 * ms, {2}},
                                       {23 * ms, 33 * ms, {3}},
                                       {33 * ms, 43 * ms, {}},
                                       {43 * ms, 45 * ms, {4}}}));
}

TEST_F(ByTime, AreNotMovedByEventsPastTheEndOfTheirInterval) {
  add(0, 10 * ms, {1'000, 900'000, 2'000});
  const auto skipped = add(10 * ms, 20 * ms, {11'000, 20'001});
  EXPECT_EQ(skipped.invalid, (InvalidEvents{.unsorted = 1}));
  EXPECT_EQ(found, (std::vector<Found>{{0, 10 * ms, {0, 2}}, {10 * ms, 20 * ms, {3}}}));
}

TEST_F(ByTime, EndWithoutAnEmptyOne) {
  add(0, 14 * ms, {1'000});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{0, 10 * ms, {0}}}));
}

TEST_F(ByTime, KeepLateEventsAtTheEndOfTheLast) {
  add(0, 10 * ms, {1'000});
  add(5 * ms, 20 * ms, {7'000, 15'000});
  EXPECT_EQ(found, (std::vector<Found>{{0, 10 * ms, {0}}, {10 * ms, 20 * ms, {1, 2}}}));
}

TEST_F(ByTime, NeverBeginAfterTheirFirstEvent) {
  queue.add({}, 0, 2 * ms, 3 * ms);
  queue.add(std::vector{Event::at(0, 0, 0, Polarity::on)}, 1000, 1 * ms, 12 * ms);
  const auto window = queue.next();
  EXPECT_EQ(found_of(*window), (Found{2 * ms, 12 * ms, {0}}));
  EXPECT_EQ(window->events.front().t, 2000);
}

TEST_F(ByTime, LeaveOutWhatIsBeforeTheStart) {
  const std::vector events = {Event::at(1, 0, 0, Polarity::on),
                              Event::at(2, 0, 4'000, Polarity::on)};
  queue.add(events, 0, 4 * ms, 14 * ms);
  EXPECT_EQ(found_of(*queue.next()), (Found{4 * ms, 14 * ms, {2}}));
}

/// Bounds of nanoseconds are rounded down, as the times of events are.
struct ByThirds : Windows {
  ByThirds() : Windows({.duration = 33'333'333}) {}
};

TEST_F(ByThirds, AreExact) {
  add(0, 100 * ms, {33'332, 33'333, 66'665, 66'666});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{0, 33'333'333, {0}},
                                       {33'333'333, 66'666'666, {1, 2}},
                                       {66'666'666, 99'999'999, {3}}}));
}

struct OverlappingByTime : Windows {
  OverlappingByTime() : Windows({.duration = 10 * ms, .overlap = 0.5}) {}
};

TEST_F(OverlappingByTime, ShareEvents) {
  add(0, 20 * ms, {1'000, 6'000, 11'000, 16'000});
  finish();
  EXPECT_EQ(found,
            (std::vector<Found>{
                {0, 10 * ms, {0, 1}}, {5 * ms, 15 * ms, {1, 2}}, {10 * ms, 20 * ms, {2, 3}}}));
}

struct ByCount : Windows {
  ByCount() : Windows({.events = 3}) {}
};

TEST_F(ByCount, LastFromTheFirstToTheLastEvent) {
  add(0, 10 * ms, {1, 2});
  add(10 * ms, 20 * ms, {10'001, 10'001, 10'005});
  add(20 * ms, 30 * ms);
  add(30 * ms, 40 * ms, {30'000, 30'001});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{1'000, 10'001'000, {0, 1, 2}},
                                       {10'001'000, 30 * ms, {3, 4, 5}},
                                       {30'001'000, 30'001'000, {6}}}));
}

struct OverlappingByCount : Windows {
  OverlappingByCount() : Windows({.events = 4, .overlap = 0.75}) {}
};

TEST_F(OverlappingByCount, ShareEvents) {
  add(0, 10 * ms, {1, 2, 3, 4, 5, 6});
  finish();
  EXPECT_EQ(found, (std::vector<Found>{{1'000, 4'000, {0, 1, 2, 3}},
                                       {2'000, 5'000, {1, 2, 3, 4}},
                                       {3'000, 6'000, {2, 3, 4, 5}}}));
}

TEST_F(ByTime, CountWhatTheySkip) {
  const std::vector events = {Event::at(100, 0, 0, Polarity::on), Event::at(0, 1, 0, Polarity::on),
                              Event::at(5, 0, 0, Polarity::on)};
  EXPECT_EQ(queue.add(events, 0, 0, 1 * ms).invalid, (InvalidEvents{.outside = 2}));
}

TEST_F(ByTime, AreBounded) {
  const std::vector<Event> many(std::size_t{1} << 23, Event::at(0, 0, 0, Polarity::on));
  EXPECT_EQ(queue.add(many, 0, 0, 1 * ms).excess, 0U);
  EXPECT_EQ(queue.add(many, 0, 0, 1 * ms).excess, 0U);
  EXPECT_EQ(queue.add(many, 0, 0, 1 * ms).excess, many.size());
}

/// Sizes of the windows of 17 million events at 2 MHz in one interval.
std::vector<std::size_t> sizes_of_long_interval(WindowQueue& queue) {
  std::vector<Event> events;
  for (std::uint32_t i = 0; i < 17'000'000; ++i)
    events.push_back(Event::at(0, 0, i / 2, Polarity::on));
  std::vector<std::size_t> sizes;
  for (std::span<const Event> rest = events; !rest.empty();) {
    const auto added = queue.add(rest, 0, 0, 8'500 * ms);
    EXPECT_EQ(added.excess + added.invalid.outside + added.invalid.unsorted, 0U);
    while (const auto window = queue.next()) sizes.push_back(window->events.size());
    rest = added.waiting;
  }
  EXPECT_FALSE(queue.finish());
  return sizes;
}

TEST(LongIntervals, AreCutIntoWindowsOfAllTheirEvents) {
  WindowQueue by_time(1, 1, {.duration = 50 * ms});
  EXPECT_EQ(sizes_of_long_interval(by_time), std::vector<std::size_t>(170, 100'000));
  WindowQueue by_count(1, 1, {.events = 50'000});
  EXPECT_EQ(sizes_of_long_interval(by_count), std::vector<std::size_t>(340, 50'000));
}

TEST(LongIntervals, LoseWhatIsTooMuchForAWindowOnly) {
  std::vector<Event> events(WindowQueue::max_events + 5, Event::at(0, 0, 0, Polarity::on));
  events.push_back(Event::at(0, 0, 1'000, Polarity::on));
  WindowQueue queue(1, 1, {.duration = 1 * ms});
  const auto added = queue.add(events, 0, 0, 2 * ms);
  EXPECT_EQ(added.excess, 5U);
  EXPECT_EQ(added.waiting.size(), 1U);
  EXPECT_EQ(queue.next()->events.size(), WindowQueue::max_events);
  EXPECT_FALSE(queue.next());
  EXPECT_TRUE(queue.add(added.waiting, 0, 0, 2 * ms).waiting.empty());
  EXPECT_EQ(queue.next()->events.size(), 1U);
}

TEST_F(ByTime, BeginAgainAfterAReset) {
  add(0, 5 * ms, {1'000});
  queue.reset();
  next_column = 7;
  add(1 * ms, 11 * ms, {2'000});
  EXPECT_EQ(found, (std::vector<Found>{{1 * ms, 11 * ms, {7}}}));
}

}  // namespace
