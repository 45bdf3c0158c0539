// SPDX-License-Identifier: LGPL-2.1-or-later
// Filters keep the same events as their plain definitions, however a stream is cut into buffers.
#include <gtest/gtest.h>

#include <stdexcept>

#include "src/filter/denoise_filter.hpp"
#include "src/filter/filter.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/rate_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/trail_filter.hpp"
#include "tests/core/targets.hpp"
#include "tests/filter/streams.hpp"
#include "tests/reference/filters.hpp"

namespace {

using namespace streams;
using eventcamera::DenoiseFilter;
using eventcamera::DenoiseMethod;
using eventcamera::HotPixelFilter;
using eventcamera::Nanoseconds;
using eventcamera::PixelPosition;
using eventcamera::RateFilter;
using eventcamera::RefractoryFilter;

constexpr SensorSize sensor{37, 23};

/// Runs a filter on several streams, in several cuts and with every SIMD target, and calls
/// expected(events) for each stream.
template <class Core, class Expected>
void expect_same(const typename Core::Settings& settings, const Expected& expected) {
  const Microseconds late = Microseconds{1} << 40;
  const Events streams[] = {
      {},
      made_scene(sensor),
      random_events(sensor, 5'000, 30, 3),
      random_events(sensor, 5'000, 0, 4),             // all at once
      random_events(sensor, 3'000, 90'000, 5, late),  // hours: stamps start over
      random_events({1, 1}, 500, 700, 6),
  };
  for (const auto& events : streams) {
    const Events kept = expected(events);
    for (const std::size_t max_buffer : {std::size_t{1}, std::size_t{50}, std::size_t{100'000}}) {
      targets::for_each([&](const char* target) {
        Core core(sensor);
        EXPECT_TRUE(filtered(core, events, settings, max_buffer, 7, max_buffer != 50) == kept)
            << events.size() << " events in buffers of " << max_buffer << ", " << target;
      });
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

TEST(Trail, KeepsPartsOfBursts) {
  using eventcamera::TrailMode;
  using reference::BurstPart;
  for (const Microseconds threshold : {1, 1000, 10'000, 100'000})
    for (const auto& [mode, which] : {std::pair{TrailMode::trail, BurstPart::first},
                                      {TrailMode::stc_cut_trail, BurstPart::second},
                                      {TrailMode::stc_keep_trail, BurstPart::all_but_first}})
      expect_same<eventcamera::TrailFilter>({.mode = mode, .threshold = threshold * 1000},
                                            [threshold, part = which](const Events& events) {
                                              return reference::trail(events, part, threshold);
                                            });
}

TEST(Denoise, KeepsEventsWithNeighbours) {
  expect_same<DenoiseFilter>({.method = DenoiseMethod::baf}, [&](const Events& events) {
    return reference::stcf(events, 2000, 1, false);
  });
  expect_same<DenoiseFilter>(
      {}, [&](const Events& events) { return reference::stcf(events, 25'000, 2, false); });
  for (const bool match_polarity : {false, true})
    expect_same<DenoiseFilter>(
        {.correlation_time = 3'000'000, .min_neighbours = 3, .match_polarity = match_polarity},
        [&](const Events& events) { return reference::stcf(events, 3000, 3, match_polarity); });
}

TEST(Denoise, KeepsEventsWithATimeKernel) {
  for (const double threshold : {0.0, 0.7, 3.0})
    expect_same<DenoiseFilter>(
        {.method = DenoiseMethod::time_kernel, .threshold = threshold},
        [&](const Events& events) { return reference::time_kernel(events, 32'000, threshold); });
}

TEST(Denoise, KeepsEventsNearOthers) {
  for (const unsigned distance : {0U, 2U, 9U})
    expect_same<DenoiseFilter>(
        {.method = DenoiseMethod::dwf, .search_distance = distance}, [&](const Events& events) {
          return reference::double_window(events, static_cast<int>(distance));
        });
}

TEST(Denoise, BeginsAgainWithAnotherMethod) {
  const Events events = made_scene(sensor);
  DenoiseFilter core(sensor);
  const auto first = filtered(core, events, {}, 1000);
  for (const auto method : {DenoiseMethod::time_kernel, DenoiseMethod::dwf, DenoiseMethod::baf})
    filtered(core, events, {.method = method}, 1000);
  core.forget();
  EXPECT_TRUE(filtered(core, events, {}, 1000) == first);
}

/// A lamp that every pixel of the sensor sees.
Events lamp(double frequency, double duty_cycle, Microseconds duration) {
  Events events;
  const double period = 1e6 / frequency;
  for (double t = 0; t < static_cast<double>(duration); t += period)
    for (int x = 0; x < 5; ++x)
      for (int i = 0; i < 3; ++i) {
        events.push_back(
            AbsoluteEvent::at(x, 2, static_cast<Microseconds>(t) + 20 * i + x, Polarity::on));
        events.push_back(AbsoluteEvent::at(
            x, 2, static_cast<Microseconds>(t + duty_cycle * period) + 20 * i + x, Polarity::off));
      }
  sort_by_time(events);
  return events;
}

TEST(Flicker, KeepsTheSameEventsAsTheReference) {
  using eventcamera::FlickerMode;
  Events scene = made_scene(sensor);
  for (const auto& [frequency, duty_cycle] :
       {std::pair{100.0, 0.5}, {100.0, 0.2}, {400.0, 0.5}, {30.0, 0.5}}) {
    Events events = lamp(frequency, duty_cycle, 1'000'000);
    events.insert(events.end(), scene.begin(), scene.end());
    sort_by_time(events);
    for (const double sought : {0.5, 0.2})
      for (const auto mode : {FlickerMode::band_stop, FlickerMode::band_pass}) {
        const reference::Flicker flicker{90, 130, sought, 4, 2};
        const auto expected = reference::flicker(events, flicker, mode == FlickerMode::band_pass);
        for (const std::size_t max_buffer : {1U, 1000U}) {
          eventcamera::FlickerFilter core(sensor);
          EXPECT_TRUE(filtered(core, events,
                               {.mode = mode,
                                .min_frequency = 90,
                                .max_frequency = 130,
                                .duty_cycle = sought,
                                .start_threshold = 4,
                                .stop_threshold = 2},
                               max_buffer) == expected);
        }
      }
  }
}

TEST(Flicker, TakesAnEmptyBandAndInvertedThresholdsAsTheNearestValid) {
  const auto kept = [](const eventcamera::FlickerFilter::Settings& settings) {
    eventcamera::FlickerFilter core(sensor);
    return filtered(core, lamp(100, 0.5, 1'000'000), settings, 100);
  };
  const auto valid =
      kept({.min_frequency = 100, .max_frequency = 100, .start_threshold = 2, .stop_threshold = 2});
  EXPECT_LT(valid.size(), 200U);
  EXPECT_TRUE(
      kept(
          {.min_frequency = 100, .max_frequency = 90, .start_threshold = 2, .stop_threshold = 7}) ==
      valid);
}

TEST(HotPixels, AreThoseOfTheReference) {
  for (const double ratio : {1.5, 4.0})
    expect_same<HotPixelFilter>({.learning_period = 300'000'000, .min_rate = 20, .ratio = ratio},
                                [&](const Events& events) {
                                  return reference::without_hot_pixels(events, sensor, 300'000, 20,
                                                                       ratio);
                                });
}

TEST(HotPixels, StayAfterAJumpAndWithoutLearning) {
  const Events events = made_scene(sensor);
  HotPixelFilter core(sensor);
  filtered(core, events, {}, 1000);
  const PixelPosition hot{static_cast<std::uint16_t>(sensor.width / 2),
                          static_cast<std::uint16_t>(sensor.height - 1)};
  core.set_hot_pixels({hot, {999, 0}});
  EXPECT_EQ(core.hot_pixels(), std::vector{hot});
  core.forget();
  const auto kept = filtered(core, events, {.learn = false}, 1000);
  EXPECT_EQ(std::ranges::count_if(
                kept, [&](const auto& event) { return event.x == hot.x && event.y() == hot.y; }),
            0);
  EXPECT_EQ(core.hot_pixels(), std::vector{hot});
}

TEST(HotPixels, AreLearntAnewWhenSettingsChange) {
  const auto fires = [](HotPixelFilter& core, Microseconds start, int count, Microseconds apart,
                        const HotPixelFilter::Settings& settings) {
    Events events;
    for (int i = 0; i < count; ++i)
      events.push_back(AbsoluteEvent::at(5, 5, start + i * apart, Polarity::on));
    filtered(core, events, settings, 10);
    return core.hot_pixels().size();
  };
  constexpr Microseconds second = 1'000'000;
  HotPixelFilter idle(sensor);  // what fires without learning does not count
  EXPECT_EQ(fires(idle, 0, 100, second, {.learn = false}), 0U);
  EXPECT_EQ(fires(idle, 100 * second, 3, second, {}), 0U);
  HotPixelFilter raised(sensor);  // within a period
  EXPECT_EQ(fires(raised, 0, 15, second / 20, {.min_rate = 10}), 0U);
  EXPECT_EQ(fires(raised, second * 15 / 20, 18, second / 10, {.min_rate = 20}), 0U);
  HotPixelFilter lowered(sensor);
  EXPECT_EQ(fires(lowered, 0, 15, second / 20, {.min_rate = 30}), 0U);
  EXPECT_EQ(fires(lowered, second, 45, second / 20, {.min_rate = 10}), 1U);
  HotPixelFilter shortened(sensor);
  EXPECT_EQ(fires(shortened, 0, 15, second / 20, {.learning_period = 3'600'000'000'000}), 0U);
  EXPECT_EQ(fires(shortened, second, 45, second / 20, {}), 1U);
}

TEST(PixelList, IsReadAsWritten) {
  const std::vector<PixelPosition> pixels = {{0, 0}, {16383, 7}, {5, 16383}};
  EXPECT_EQ(eventcamera::parse_pixel_list(eventcamera::pixel_list_text(pixels)), pixels);
  EXPECT_EQ(eventcamera::parse_pixel_list(" 1,2 \r\n\n# 3 4\n5\t6"),
            (std::vector<PixelPosition>{{1, 2}, {5, 6}}));
  for (const char* text : {"1", "1 2 3", "x 1", "-1 2", "1 16384", "1 99999999999", "1 2\n,"})
    EXPECT_THROW(eventcamera::parse_pixel_list(text), std::invalid_argument) << text;
}

/// Events per second in a window.
double rate(const Events& events, Microseconds from, Microseconds to) {
  const auto count = std::ranges::count_if(
      events, [&](const auto& event) { return event.t >= from && event.t < to; });
  return static_cast<double>(count) * 1e6 / static_cast<double>(to - from);
}

TEST(Rate, IsLimitedWhateverTheBuffers) {
  // 200 000 events/s, in a second of which there are a million more.
  Events events = random_events(sensor, 600'000, 5, 1);
  const auto flood = random_events(sensor, 1'000'000, 1, 2, 1'000'000);
  events.insert(events.end(), flood.begin(), flood.end());
  sort_by_time(events);
  const RateFilter::Settings settings{.max_rate = 300'000};
  RateFilter core(sensor);
  const auto kept = filtered(core, events, settings, 1'000'000, 7, false);
  RateFilter other(sensor);
  EXPECT_TRUE(filtered(other, events, settings, 700, 8, false) == kept);
  // Nothing is lost before.
  EXPECT_EQ(rate(kept, 0, 990'000), rate(events, 0, 990'000));
  EXPECT_NEAR(rate(kept, 1'000'000, 2'000'000), 300'000, 3000);
  EXPECT_LT(rate(kept, 1'000'000, 1'010'000), 1'000'000);
  for (Microseconds t = 1'050'000; t < 1'950'000; t += 10'000)
    EXPECT_NEAR(rate(kept, t, t + 10'000), 300'000, 15'000) << t;
  // What is kept is spread over the period and over the picture.
  for (Microseconds t = 1'100'000; t < 1'200'000; t += 1'000)
    EXPECT_NEAR(rate(kept, t, t + 1'000), 300'000, 30'000) << t;
  std::vector<int> columns(sensor.width);
  for (const auto& event : kept)
    if (event.t >= 1'100'000 && event.t < 1'900'000) ++columns[event.x];
  for (const int count : columns) EXPECT_NEAR(count, 240'000 / sensor.width, 400);
  const auto after = kept.back().t - 200'000;
  EXPECT_EQ(rate(kept, after, after + 200'000), rate(events, after, after + 200'000));
}

TEST(Rate, IsUnlimitedAtZero) {
  const Events events = random_events(sensor, 10'000, 0, 1);
  RateFilter core(sensor);
  EXPECT_TRUE(filtered(core, events, {.max_rate = 0}, 100) == events);
}

TEST(Rate, AddsUpFractionsOfEvents) {
  for (const Nanoseconds period : {10'000, 1'500'000}) {  // for 0.01 and 1.5 events
    const auto kept_of = [&](Microseconds distance) {
      Events events;
      for (Microseconds t = 0; t < 10'000'000; t += distance)
        events.push_back(AbsoluteEvent::at(1, 1, t, Polarity::on));
      RateFilter core(sensor);
      const RateFilter::Settings settings{.max_rate = 1000, .reference_period = period};
      return rate(filtered(core, events, settings, 100'000), 0, 10'000'000);
    };
    EXPECT_EQ(kept_of(10'000), 100);
    EXPECT_EQ(kept_of(1000), 1000);
    for (const Microseconds distance : {2, 500}) EXPECT_NEAR(kept_of(distance), 1000, 2);
  }
}

TEST(Rate, OfAlternatingLoadIsLimited) {
  // 20,000 events in every other 10 ms for ten seconds, then a million a second.
  Events events;
  for (Microseconds burst = 0; burst < 10'000'000; burst += 20'000)
    for (int i = 0; i < 20'000; ++i)
      events.push_back(AbsoluteEvent::at(1, 1, burst + i / 2, Polarity::on));
  for (Microseconds t = 10'000'000; t < 12'000'000; ++t)
    events.push_back(AbsoluteEvent::at(1, 1, t, Polarity::on));
  RateFilter core(sensor);
  const auto kept = filtered(core, events, {.max_rate = 100'000}, 100'000);
  EXPECT_LE(rate(kept, 0, 10'000'000), 100'000);
  EXPECT_NEAR(rate(kept, 11'000'000, 12'000'000), 100'000, 5'000);
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
