// SPDX-License-Identifier: LGPL-2.1-or-later
// Merges streams and compares with all their events, sorted.
#include "src/filter/event_merge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

namespace {

using namespace eventcamera;

constexpr SensorSize sensor{64, 48};

struct LabelledEvent {
  AbsoluteEvent event;
  Label label;

  friend bool operator==(const LabelledEvent&, const LabelledEvent&) = default;
};
using Stream = std::vector<LabelledEvent>;

/// Stream of an input, and how it is cut.
struct Source {
  Stream events;
  std::vector<Microseconds> cuts;
  int x = 0;
  int y = 0;
  bool labelled = true;

  std::size_t interval = 0;
  MergeInput input{};

  bool is_over() const { return interval + 1 >= cuts.size(); }

  /// Loads the next interval, without the events at its end.
  void load() {
    const auto start = cuts[interval];
    const auto end = cuts[++interval];
    std::vector<Event> part;
    std::vector<Label> labels;
    for (const auto& [event, label] : events) {
      if (event.t < start || event.t >= end) continue;
      part.push_back({static_cast<std::uint32_t>(event.t - start), event.x, event.y_p});
      labels.push_back(label);
    }
    if (!labelled) labels.clear();
    const auto invalid = input.load(part, labels, sensor, end - start);
    EXPECT_EQ(invalid.outside + invalid.unsorted, 0U);
    input.place(start, x, y);
  }
};

/// Merges to the end. Every interval must follow the one before.
Stream merged(std::vector<Source>& sources) {
  Stream merged;
  EventMerger merger;
  std::optional<Microseconds> position;
  while (true) {
    std::vector<MergeInput*> inputs;
    for (auto& source : sources) {
      if (!source.input.is_loaded() && !source.is_over()) source.load();
      if (source.input.is_loaded()) inputs.push_back(&source.input);
    }
    if (inputs.empty()) return merged;
    const auto interval = merger.next(inputs);
    EXPECT_EQ(position.value_or(interval.start), interval.start);
    EXPECT_GE(interval.end, interval.start);
    EXPECT_EQ(interval.late, 0U);
    position = interval.end;
    std::vector<Event> events(interval.events);
    std::vector<Label> labels(interval.labelled ? interval.events : 0);
    EventMerger::merge(inputs, interval, {events, labels});
    for (std::size_t i = 0; i < events.size(); ++i) {
      EXPECT_LE(interval.start + events[i].t, interval.end);
      merged.push_back({{interval.start + events[i].t, events[i].x, events[i].y_p},
                        interval.labelled ? labels[i] : Label{}});
    }
    for (auto* input : inputs)
      if (input->is_merged(interval.end)) input->unload();
  }
}

/// All events in order of time and, within a microsecond, of the sources.
Stream sorted(const std::vector<Source>& sources) {
  Stream all;
  for (const auto& source : sources) {
    for (auto [event, label] : source.events) {
      event.x = static_cast<std::uint16_t>(event.x + source.x);
      event.y_p = static_cast<std::uint16_t>(event.y_p + source.y);
      all.push_back({event, source.labelled ? label : Label{}});
    }
  }
  std::ranges::stable_sort(all, {}, [](const LabelledEvent& item) { return item.event.t; });
  return all;
}

/// A stream in [0, length) whose times are often equal, cut at random times.
Source random_source(std::mt19937& random, Microseconds length, std::size_t count) {
  const auto below = [&](Microseconds end) {
    return std::uniform_int_distribution<Microseconds>(0, end - 1)(random);
  };
  Source source;
  for (std::size_t i = 0; i < count; ++i)
    source.events.push_back(
        {AbsoluteEvent::at(static_cast<int>(below(sensor.width)),
                           static_cast<int>(below(sensor.height)), below(length),
                           below(2) == 0 ? Polarity::off : Polarity::on),
         {.object_class = static_cast<std::uint16_t>(below(9)), .cause = Cause::light}});
  std::ranges::stable_sort(source.events, {}, [](const auto& item) { return item.event.t; });
  source.cuts = {0, length};
  for (auto cuts = below(20); cuts > 0; --cuts) source.cuts.push_back(below(length));
  std::ranges::sort(source.cuts);
  return source;
}

TEST(EventMerge, SortsAllEventsWhereverTheStreamsAreCut) {
  std::mt19937 random(1);  // NOLINT(bugprone-random-generator-seed): reproducible
  for (int times = 0; times < 200; ++times) {
    std::vector<Source> sources;
    for (auto count = 1 + random() % 4; count > 0; --count) {
      auto source = random_source(random, 1 + random() % 1000, random() % 1500);
      source.x = static_cast<int>(random() % 1000);
      source.y = static_cast<int>(random() % 1000);
      source.labelled = random() % 2 == 0;
      sources.push_back(std::move(source));
    }
    const auto expected = sorted(sources);
    ASSERT_EQ(merged(sources), expected);
  }
}

void load(MergeInput& input, const std::vector<std::uint32_t>& times, Microseconds start,
          Microseconds end) {
  std::vector<Event> events;
  for (const auto t : times) events.push_back(Event::at(1, 1, t, Polarity::on));
  input.load(events, {}, sensor, end - start);
  input.place(start, 0, 0);
}

TEST(EventMerge, HasTheEventsAtTheEndOfAnInterval) {
  MergeInput input;
  load(input, {0, 10}, 100, 110);
  MergeInput* const inputs[] = {&input};
  EventMerger merger;
  EXPECT_EQ(merger.next(inputs).events, 2U);
}

TEST(EventMerge, DropsLateEvents) {
  MergeInput input;
  MergeInput* const inputs[] = {&input};
  EventMerger merger;
  load(input, {0}, 100, 200);
  merger.next(inputs);
  load(input, {0, 49, 50, 60}, 150, 210);
  const auto interval = merger.next(inputs);
  EXPECT_EQ(interval.start, 200);
  EXPECT_EQ(interval.late, 2U);
  EXPECT_EQ(interval.events, 2U);
  load(input, {0, 1}, 150, 160);
  const auto empty = merger.next(inputs);
  EXPECT_EQ(empty.late, 2U);
  EXPECT_EQ(empty.events, 0U);
  EXPECT_EQ(empty.end, 210);
  merger.restart();
  load(input, {0, 1}, 150, 160);
  EXPECT_EQ(merger.next(inputs).events, 2U);
}

TEST(EventMerge, LeavesPausesBetweenIntervalsEmpty) {
  MergeInput input;
  MergeInput* const inputs[] = {&input};
  EventMerger merger;
  load(input, {0}, 100, 200);
  merger.next(inputs);
  load(input, {0}, 1000, 1100);
  const auto pause = merger.next(inputs);
  EXPECT_EQ(std::tuple(pause.start, pause.end, pause.events), std::tuple(200, 1000, 0U));
  const auto after = merger.next(inputs);
  EXPECT_EQ(std::tuple(after.start, after.end, after.events), std::tuple(1000, 1100, 1U));
}

/// One input has no events for hours, the other has some at their end.
TEST(EventMerge, KeepsTimesWithin32Bits) {
  constexpr Microseconds hours = 20'000'000'000;
  MergeInput silent;
  MergeInput late;
  load(silent, {}, 0, hours);
  load(late, {5, 6}, hours - 10, hours);
  MergeInput* const inputs[] = {&silent, &late};
  EventMerger merger;
  const auto pause = merger.next(inputs);
  EXPECT_EQ(std::tuple(pause.start, pause.end, pause.events), std::tuple(0, hours - 5, 0U));
  const auto interval = merger.next(inputs);
  ASSERT_EQ(std::tuple(interval.start, interval.end, interval.events),
            std::tuple(hours - 5, hours, 2U));
  std::vector<Event> events(2);
  EventMerger::merge(inputs, interval, {events, {}});
  EXPECT_EQ(events[0].t, 0U);
  EXPECT_EQ(events[1].t, 1U);
}

TEST(EventMerge, DropsInvalidEvents) {
  const Event events[] = {Event::at(0, 0, 5, Polarity::on),  Event::at(64, 0, 5, Polarity::on),
                          Event::at(0, 48, 5, Polarity::on), Event::at(0, 0, 4, Polarity::on),
                          Event::at(0, 0, 11, Polarity::on), Event::at(1, 0, 10, Polarity::on)};
  MergeInput input;
  const auto invalid = input.load(events, {}, sensor, 10);
  EXPECT_EQ(invalid.outside, 2U);
  EXPECT_EQ(invalid.unsorted, 2U);
  input.place(0, 0, 0);
  MergeInput* const inputs[] = {&input};
  EXPECT_EQ(EventMerger().next(inputs).events, 2U);
}

}  // namespace
