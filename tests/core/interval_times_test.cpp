// SPDX-License-Identifier: LGPL-2.1-or-later
// Times counted from the start of an interval equal the plain reference on every SIMD target.
#include "src/core/interval_times.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/core/targets.hpp"

namespace {

using namespace eventcamera;

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
