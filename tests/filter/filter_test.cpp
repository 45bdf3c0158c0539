// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters keep the same events as their plain definitions, however a stream is cut into buffers.
#include <gtest/gtest.h>

#include "src/filter/refractory_filter.hpp"
#include "src/filter/valid_events.hpp"
#include "tests/filter/streams.hpp"
#include "tests/reference/filters.hpp"

namespace {

using namespace streams;
using eventcamera::RefractoryFilter;

constexpr SensorSize sensor{37, 23};

/// Runs a filter on several streams in several cuts, and calls expected(events) for each stream.
template <class Core, class Expected>
void expect_same(const typename Core::Settings& settings, const Expected& expected) {
  const Microseconds late = Microseconds{1} << 40;
  const Events streams[] = {
      {},
      made_scene(sensor),
      random_events(sensor, 20'000, 30, 3),
      random_events(sensor, 20'000, 0, 4),            // all at once
      random_events(sensor, 3'000, 90'000, 5, late),  // hours: stamps start over
      random_events({1, 1}, 500, 700, 6),
  };
  for (const auto& events : streams) {
    const Events kept = expected(events);
    for (const std::size_t max_buffer : {std::size_t{1}, std::size_t{50}, std::size_t{100'000}}) {
      Core core(sensor);
      EXPECT_TRUE(filtered(core, events, settings, max_buffer, 7, max_buffer != 50) == kept)
          << events.size() << " events in buffers of " << max_buffer;
    }
  }
}

TEST(Refractory, KeepsWhatAPixelWithThePeriodFires) {
  for (const Microseconds period : {0, 1, 700, 10'000, 1'000'000})
    expect_same<RefractoryFilter>({.refractory_period = period * 1000}, [&](const Events& events) {
      return reference::refractory(events, period);
    });
}

TEST(Refractory, RoundsThePeriodUp) {
  const Events events = {AbsoluteEvent::at(0, 0, 10, Polarity::on),
                         AbsoluteEvent::at(0, 0, 12, Polarity::on),
                         AbsoluteEvent::at(0, 0, 13, Polarity::on)};
  RefractoryFilter core(sensor);
  EXPECT_EQ(filtered(core, events, {.refractory_period = 2001}, 9), (Events{events[0], events[2]}));
}

TEST(Refractory, ForgetsEveryPixel) {
  const Events events = made_scene(sensor);
  RefractoryFilter core(sensor);
  const auto first = filtered(core, events, {}, 1000);
  core.forget();
  EXPECT_TRUE(filtered(core, events, {}, 1000) == first);
}

TEST(ValidEvents, AreKeptAsTheyAre) {
  std::vector<Event> events = {Event::at(36, 22, 0, Polarity::on),
                               Event::at(0, 0, 9, Polarity::off)};
  const auto before = events;
  eventcamera::InvalidEvents invalid;
  EXPECT_EQ(eventcamera::keep_valid({events, {}}, sensor, 9, invalid).events.size(), 2U);
  EXPECT_EQ(events, before);
  EXPECT_EQ(invalid.outside + invalid.unsorted, 0U);
}

TEST(ValidEvents, AreKeptBetweenInvalidOnes) {
  const auto good = [](std::uint32_t t) { return Event::at(1, 1, t, Polarity::on); };
  std::vector<Event> events = {Event::at(37, 0, 0, Polarity::on),           good(5), good(4),
                               Event::at(0, 23, 6, Polarity::on),           good(7), good(11),
                               Event::at(0x7fff, 0x7fff, 8, Polarity::off), good(10)};
  eventcamera::InvalidEvents invalid;
  const auto left = eventcamera::keep_valid({events, {}}, sensor, 10, invalid).events;
  EXPECT_EQ(std::vector(left.begin(), left.end()), (std::vector{good(5), good(7), good(10)}));
  EXPECT_EQ(invalid.outside, 3U);
  EXPECT_EQ(invalid.unsorted, 2U);
}

}  // namespace
