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

/// Columns are the numbers of the events, in the order in which they were added.
class Feed {
 public:
  explicit Feed(const WindowSettings& settings) : queue(100, 1, settings) {}

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

const WindowSettings by_time{.duration = 10 * ms};
const WindowSettings pairs{.intervals = 2};

struct Interval {
  Nanoseconds start;
  Nanoseconds end;
  std::vector<Microseconds> times;
};

struct Case {
  WindowSettings settings;
  std::vector<Interval> intervals;
  std::vector<Found> windows;
};

TEST(Windows, AreTheseOfAFinishedStream) {
  const std::vector<Interval> five = {{0, 1 * ms, {0}},
                                      {1 * ms, 2 * ms, {1'000}},
                                      {2 * ms, 3 * ms, {2'000}},
                                      {3 * ms, 4 * ms, {3'000}},
                                      {4 * ms, 5 * ms, {4'000}}};
  const Case cases[] = {
      {{},
       {{0, 10 * ms, {0, 5, 10'000}}, {10 * ms, 20 * ms, {}}, {20 * ms + 1, 30 * ms, {20'000}}},
       {{0, 10 * ms, {0, 1, 2}}, {10 * ms, 20 * ms, {}}, {20 * ms + 1, 30 * ms, {3}}}},
      {{.intervals = 3, .overlap = 0.67},
       five,
       {{0, 3 * ms, {0, 1, 2}}, {1 * ms, 4 * ms, {1, 2, 3}}, {2 * ms, 5 * ms, {2, 3, 4}}}},
      {pairs, five, {{0, 2 * ms, {0, 1}}, {2 * ms, 4 * ms, {2, 3}}, {4 * ms, 5 * ms, {4}}}},
      // They do not depend on how the events come; a window excludes its end.
      {by_time,
       {{3 * ms, 14 * ms, {3'000, 12'999, 13'000}},
        {14 * ms, 40 * ms, {32'999}},
        {40 * ms, 45 * ms, {44'000}}},
       {{3 * ms, 13 * ms, {0, 1}},
        {13 * ms, 23 * ms, {2}},
        {23 * ms, 33 * ms, {3}},
        {33 * ms, 43 * ms, {}},
        {43 * ms, 45 * ms, {4}}}},
      // No empty one at the end.
      {by_time, {{0, 14 * ms, {1'000}}}, {{0, 10 * ms, {0}}}},
      // Bounds of nanoseconds are rounded down, as the times of events are.
      {{.duration = 33'333'333},
       {{0, 100 * ms, {33'332, 33'333, 66'665, 66'666}}},
       {{0, 33'333'333, {0}}, {33'333'333, 66'666'666, {1, 2}}, {66'666'666, 99'999'999, {3}}}},
      {{.duration = 10 * ms, .overlap = 0.5},
       {{0, 20 * ms, {1'000, 6'000, 11'000, 16'000}}},
       {{0, 10 * ms, {0, 1}}, {5 * ms, 15 * ms, {1, 2}}, {10 * ms, 20 * ms, {2, 3}}}},
      // From the first to the last event.
      {{.events = 3},
       {{0, 10 * ms, {1, 2}},
        {10 * ms, 20 * ms, {10'001, 10'001, 10'005}},
        {20 * ms, 30 * ms, {}},
        {30 * ms, 40 * ms, {30'000, 30'001}}},
       {{1'000, 10'001'000, {0, 1, 2}},
        {10'001'000, 30 * ms, {3, 4, 5}},
        {30'001'000, 30'001'000, {6}}}},
      {{.events = 4, .overlap = 0.75},
       {{0, 10 * ms, {1, 2, 3, 4, 5, 6}}},
       {{1'000, 4'000, {0, 1, 2, 3}}, {2'000, 5'000, {1, 2, 3, 4}}, {3'000, 6'000, {2, 3, 4, 5}}}},
  };
  for (const auto& [settings, intervals, windows] : cases) {
    Feed feed(settings);
    for (const auto& [start, end, times] : intervals) feed.add(start, end, times);
    feed.finish();
    EXPECT_EQ(feed.found, windows);
  }
}

/// An interval that steps back begins where the last one ended, and so do its events.
TEST(Windows, NeverGoBack) {
  WindowQueue queue(100, 1, pairs);
  queue.add({}, 0, 2 * ms, 3 * ms);
  queue.add(std::vector{Event::at(0, 0, 0, Polarity::on)}, 1000, 1 * ms, 2 * ms);
  const auto window = queue.next();
  EXPECT_EQ(found_of(*window), (Found{2 * ms, 3 * ms, {0}}));
  EXPECT_EQ(window->events.front().t, 3000);
}

TEST(WindowsByTime, AreNotMovedByEventsPastTheEndOfTheirInterval) {
  Feed feed(by_time);
  feed.add(0, 10 * ms, {1'000, 900'000, 2'000});
  const auto skipped = feed.add(10 * ms, 20 * ms, {11'000, 20'001});
  EXPECT_EQ(skipped.invalid, (InvalidEvents{.unsorted = 1}));
  EXPECT_EQ(feed.found, (std::vector<Found>{{0, 10 * ms, {0, 2}}, {10 * ms, 20 * ms, {3}}}));
}

TEST(WindowsByTime, KeepLateEventsAtTheEndOfTheLast) {
  Feed feed(by_time);
  feed.add(0, 10 * ms, {1'000});
  feed.add(5 * ms, 20 * ms, {7'000, 15'000});
  EXPECT_EQ(feed.found, (std::vector<Found>{{0, 10 * ms, {0}}, {10 * ms, 20 * ms, {1, 2}}}));
}

TEST(WindowsByTime, NeverBeginAfterTheirFirstEvent) {
  WindowQueue queue(100, 1, by_time);
  queue.add({}, 0, 2 * ms, 3 * ms);
  queue.add(std::vector{Event::at(0, 0, 0, Polarity::on)}, 1000, 1 * ms, 12 * ms);
  const auto window = queue.next();
  EXPECT_EQ(found_of(*window), (Found{2 * ms, 12 * ms, {0}}));
  EXPECT_EQ(window->events.front().t, 2000);
}

TEST(WindowsByTime, LeaveOutWhatIsBeforeTheStart) {
  WindowQueue queue(100, 1, by_time);
  const std::vector events = {Event::at(1, 0, 0, Polarity::on),
                              Event::at(2, 0, 4'000, Polarity::on)};
  queue.add(events, 0, 4 * ms, 14 * ms);
  EXPECT_EQ(found_of(*queue.next()), (Found{4 * ms, 14 * ms, {2}}));
}

TEST(WindowsByTime, CountWhatTheySkip) {
  WindowQueue queue(100, 1, by_time);
  const std::vector events = {Event::at(100, 0, 0, Polarity::on), Event::at(0, 1, 0, Polarity::on),
                              Event::at(5, 0, 0, Polarity::on)};
  EXPECT_EQ(queue.add(events, 0, 0, 1 * ms).invalid, (InvalidEvents{.outside = 2}));
}

TEST(WindowsByTime, AreBounded) {
  WindowQueue queue(100, 1, by_time);
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
  WindowQueue timed(1, 1, {.duration = 50 * ms});
  EXPECT_EQ(sizes_of_long_interval(timed), std::vector<std::size_t>(170, 100'000));
  WindowQueue counted(1, 1, {.events = 50'000});
  EXPECT_EQ(sizes_of_long_interval(counted), std::vector<std::size_t>(340, 50'000));
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

TEST(WindowsByTime, BeginAgainAfterAReset) {
  Feed feed(by_time);
  feed.add(0, 5 * ms, {1'000});
  feed.queue.reset();
  feed.next_column = 7;
  feed.add(1 * ms, 11 * ms, {2'000});
  EXPECT_EQ(feed.found, (std::vector<Found>{{1 * ms, 11 * ms, {7}}}));
}

}  // namespace
