// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares pictures of known events to ones drawn by the definition of each mode.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "src/render/accumulator.hpp"
#include "src/render/renderer.hpp"

namespace {

using namespace eventcamera;

constexpr int width = 37;
constexpr int height = 21;

/// Sorted random events at 1 ... duration microseconds.
std::vector<Event> events_by_chance(int count, int duration, unsigned seed) {
  std::minstd_rand random(seed);
  const auto below = [&random](int n) { return std::uniform_int_distribution<>(0, n - 1)(random); };
  std::vector<int> times(static_cast<std::size_t>(count));
  std::ranges::generate(times, [&] { return 1 + below(duration); });
  std::ranges::sort(times);
  std::vector<Event> events;
  for (const int t : times)
    events.push_back(Event::at(below(width), below(height), static_cast<std::uint32_t>(t),
                               below(2) == 0 ? Polarity::off : Polarity::on));
  return events;
}

using Picture = std::vector<std::uint8_t>;

Picture draw(Renderer& renderer, Microseconds start, Microseconds end,
             const PixelLayout& layout = {}) {
  const std::ptrdiff_t stride = renderer.width() * layout.bytes + 3;
  Picture picture(static_cast<std::size_t>(stride * renderer.height()), 7);
  renderer.draw(start, end, layout, reinterpret_cast<std::byte*>(picture.data()), stride);
  return picture;
}

/// Draws a grey picture pixel by pixel.
template <class Value>
Picture plainly(const Value& grey_of) {
  Picture picture;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) picture.push_back(grey_of(x, y));
    picture.insert(picture.end(), 3, 7);
  }
  return picture;
}

struct Sum {
  int on = 0;
  int off = 0;
};

std::vector<Sum> sums_of(std::span<const Event> events) {
  std::vector<Sum> sums(width * height);
  for (const auto& e : events) {
    auto& sum = sums[static_cast<std::size_t>(e.y() * width + e.x)];
    ++(e.polarity() == Polarity::on ? sum.on : sum.off);
  }
  return sums;
}

Picture accumulated(std::span<const Event> events, PaletteName name) {
  const auto sums = sums_of(events);
  const auto& colours = palette(name);
  return plainly([&](int x, int y) {
    const auto& sum = sums[static_cast<std::size_t>(y * width + x)];
    return luma(sum.on > 0 && sum.off > 0 ? colours.both
                : sum.on > 0              ? colours.on
                : sum.off > 0             ? colours.off
                                          : colours.none);
  });
}

std::uint8_t grey_shade(double value) {
  return luma(shades(PaletteName::grey)[shade(static_cast<float>(value))]);
}

Picture counted(std::span<const Event> events, double full_scale) {
  const auto sums = sums_of(events);
  return plainly([&](int x, int y) {
    const auto& sum = sums[static_cast<std::size_t>(y * width + x)];
    return grey_shade((sum.on - sum.off) / full_scale);
  });
}

std::span<const Event> between(const std::vector<Event>& events, int start, int end) {
  const auto after = [](int time, const Event& e) { return time < static_cast<int>(e.t); };
  return {std::upper_bound(events.begin(), events.end(), start, after),
          std::upper_bound(events.begin(), events.end(), end, after)};
}

/// Largest difference between the bytes of two pictures.
int distance(const Picture& a, const Picture& b) {
  int max_difference = a.size() == b.size() ? 0 : 255;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    max_difference = std::max(max_difference, std::abs(a[i] - b[i]));
  return max_difference;
}

TEST(Renderer, DrawsAnIntervalAsTheAccumulatorDoes) {
  const auto events = events_by_chance(600, 33'333, 1);
  for (const auto& layout : {PixelLayout{}, PixelLayout{.bytes = 3, .red = 2, .blue = 0},
                             PixelLayout{.bytes = 4, .red = 1, .green = 2, .blue = 3}}) {
    for (const auto name : {PaletteName::dark, PaletteName::red_blue, PaletteName::viridis}) {
      Renderer renderer(width, height, {.palette = name});
      renderer.add(events, 5'000'000);
      Accumulator accumulator(width, height);
      accumulator.add(events);
      const std::ptrdiff_t stride = width * layout.bytes + 3;
      Picture picture(static_cast<std::size_t>(stride * height), 7);
      ThreadPool threads;
      accumulator.draw(palette(name), layout, reinterpret_cast<std::byte*>(picture.data()), stride,
                       threads);
      EXPECT_EQ(draw(renderer, 5'000'000, 5'033'333, layout), picture);
    }
  }
}

/// Windows longer and shorter than the time between pictures.
TEST(Renderer, DrawsWindowsThatOverlap) {
  const auto events = events_by_chance(6000, 100'000, 2);
  for (const auto mode : {RenderMode::accumulate, RenderMode::count}) {
    for (const int window : {500, 4000, 17'000, 200'000}) {
      Renderer renderer(width, height,
                        {.mode = mode, .palette = PaletteName::grey, .full_scale = 2});
      for (int end = 4000; end <= 100'000; end += 4000) {
        renderer.add(between(events, end - 4000, end), 0);
        const auto shown = between(events, end - window, end);
        ASSERT_EQ(draw(renderer, end - window, end), mode == RenderMode::count
                                                         ? counted(shown, 2)
                                                         : accumulated(shown, PaletteName::grey))
            << "mode " << static_cast<int>(mode) << ", window " << window << ", end " << end;
      }
    }
  }
}

constexpr Microseconds ever = -1'000'000;

TEST(Renderer, DrawsTheLastSoManyEvents) {
  const auto events = events_by_chance(3000, 100'000, 3);
  Renderer renderer(width, height, {.palette = PaletteName::grey, .limits = {.events = 250}});
  for (std::size_t i = 0; i < events.size(); i += 100) {
    renderer.add(std::span(events).subspan(i, 100), 0);
    const auto end = events[i + 99].t;
    const std::size_t first = i + 100 < 250 ? 0 : i + 100 - 250;
    ASSERT_EQ(draw(renderer, ever, end),
              accumulated(std::span(events).subspan(first, i + 100 - first), PaletteName::grey));
  }
}

/// Longest run of latest events with at most the limit in each area.
TEST(Renderer, DrawsUntilAnAreaIsFull) {
  const auto events = events_by_chance(3000, 100'000, 4);
  constexpr int side = 8;
  constexpr int share = 12;
  Renderer renderer(
      width, height,
      {.palette = PaletteName::grey, .limits = {.area_events = share, .area_side = side}});
  for (std::size_t i = 0; i < events.size(); i += 50) {
    renderer.add(std::span(events).subspan(i, 50), 0);
    std::array<int, 15> areas{};
    std::size_t first = i + 50;
    while (first > 0) {
      const auto& e = events[first - 1];
      if (++areas[static_cast<std::size_t>(e.y() / side * 5 + e.x / side)] > share) break;
      --first;
    }
    const auto picture = draw(renderer, ever, events[i + 49].t);
    ASSERT_EQ(picture,
              accumulated(std::span(events).subspan(first, i + 50 - first), PaletteName::grey));
  }
}

TEST(Renderer, LetsSumsDecay) {
  const auto events = events_by_chance(4000, 100'000, 5);
  constexpr int time_constant = 15'000;
  constexpr double full_scale = 4;
  Renderer renderer(width, height,
                    {.mode = RenderMode::decay,
                     .palette = PaletteName::grey,
                     .time_constant = time_constant,
                     .full_scale = full_scale});
  for (int end = 10'000; end <= 100'000; end += 10'000) {
    renderer.add(between(events, end - 10'000, end), 0);
    std::vector<double> sums(width * height);
    std::vector<double> times(width * height);
    for (const auto& e : between(events, 0, end)) {
      const auto at = static_cast<std::size_t>(e.y() * width + e.x);
      const double left = sums[at] * std::exp((times[at] - e.t) / time_constant);
      sums[at] =
          std::clamp(left + (e.polarity() == Polarity::on ? 1 : -1), -full_scale, full_scale);
      times[at] = e.t;
    }
    const auto picture = plainly([&](int x, int y) {
      const auto at = static_cast<std::size_t>(y * width + x);
      return grey_shade(sums[at] * std::exp((times[at] - end) / time_constant) / full_scale);
    });
    ASSERT_LE(distance(draw(renderer, 0, end), picture), 3);
  }
}

TEST(Renderer, ShowsTheAgeOfTheLastEvent) {
  const auto events = events_by_chance(1500, 100'000, 6);
  constexpr int time_constant = 30'000;
  Renderer renderer(width, height,
                    {.mode = RenderMode::time_surface,
                     .palette = PaletteName::grey,
                     .time_constant = time_constant});
  for (int end = 10'000; end <= 100'000; end += 10'000) {
    renderer.add(between(events, end - 10'000, end), 0);
    std::vector<double> values(width * height);
    for (const auto& e : between(events, end - time_constant, end)) {
      const double young = 1 - (end - static_cast<double>(e.t)) / time_constant;
      values[static_cast<std::size_t>(e.y() * width + e.x)] =
          e.polarity() == Polarity::on ? young : -young;
    }
    const auto picture = plainly(
        [&](int x, int y) { return grey_shade(values[static_cast<std::size_t>(y * width + x)]); });
    ASSERT_LE(distance(draw(renderer, 0, end), picture), 3);
  }
}

constexpr RenderMode modes[] = {RenderMode::accumulate, RenderMode::decay, RenderMode::time_surface,
                                RenderMode::count};

TEST(Renderer, LeavesOutWhatLiesOutside) {
  const Event outside[] = {
      Event::at(width, 0, 1, Polarity::on), Event::at(0, height, 2, Polarity::off),
      Event::at(65535, 32767, 3, Polarity::on), Event::at(3, 2, 4, Polarity::on)};
  for (const auto mode : modes) {
    const RenderSettings settings{.mode = mode, .limits = {.area_events = 5}};
    Renderer renderer(width, height, settings);
    EXPECT_EQ(renderer.add(outside, 0).outside, 3U);
    Renderer other(width, height, settings);
    EXPECT_EQ(other.add({outside + 3, 1}, 0), InvalidEvents{});
    EXPECT_EQ(draw(renderer, 0, 10), draw(other, 0, 10));
  }
}

/// An event past the end of its buffer does not delay those that follow.
TEST(Renderer, LeavesOutWhatIsPastTheEnd) {
  const Event events[] = {Event::at(3, 2, 4, Polarity::on), Event::at(1, 2, 900'000, Polarity::on)};
  for (const auto mode : modes) {
    Renderer renderer(width, height, {.mode = mode});
    EXPECT_EQ(renderer.add(events, 0, 10), (InvalidEvents{.unsorted = 1}));
    Renderer other(width, height, {.mode = mode});
    other.add({events, 1}, 0);
    EXPECT_EQ(draw(renderer, 0, 10), draw(other, 0, 10));
  }
}

TEST(Renderer, ShowsLateEventsInTheNextPicture) {
  const Event late[] = {Event::at(3, 2, 500, Polarity::on)};
  for (const auto mode : modes) {
    Renderer renderer(width, height, {.mode = mode, .palette = PaletteName::grey});
    const auto blank = draw(renderer, 0, 1000);
    renderer.add(late, 0);
    EXPECT_NE(draw(renderer, 1000, 2000), blank);
  }
}

TEST(Renderer, ForgetsAllWhenReset) {
  const auto events = events_by_chance(500, 900, 7);
  for (const auto mode : modes) {
    Renderer renderer(width, height, {.mode = mode, .palette = PaletteName::grey});
    const auto blank = draw(renderer, 0, 1'000'000);
    renderer.reset();
    renderer.add(events, 0);
    EXPECT_NE(draw(renderer, 0, 1000), blank);  // time has started over, too
    renderer.reset();
    EXPECT_EQ(draw(renderer, 0, 1000), blank);
  }
}

TEST(Renderer, KeepsWhatItShowsWhenRepainted) {
  const auto events = events_by_chance(500, 900, 8);
  for (const auto mode : modes) {
    RenderSettings settings{.mode = mode, .palette = PaletteName::grey};
    Renderer renderer(width, height, settings);
    renderer.add(events, 0);
    settings.palette = PaletteName::magma;
    renderer.configure(settings);
    Renderer other(width, height, settings);
    other.add(events, 0);
    EXPECT_EQ(draw(renderer, 0, 1000), draw(other, 0, 1000));
  }
}

/// An infinite window at an unbounded event rate.
TEST(Renderer, KeepsSoManyEventsAndNoMore) {
  constexpr std::size_t more = RecentEvents::max_size + 10;
  Renderer renderer(width, height, {.mode = RenderMode::count, .full_scale = 100});
  const std::vector<Event> early(20, Event::at(1, 1, 1, Polarity::on));
  const std::vector<Event> rest(more - 20, Event::at(2, 2, 2, Polarity::off));
  renderer.add(early, 0);
  renderer.add(rest, 0);
  Renderer other(width, height, {.mode = RenderMode::count, .full_scale = 100});
  other.add({early.data(), 10}, 0);
  other.add({rest.data(), 200}, 0);
  EXPECT_EQ(draw(renderer, ever, 10), draw(other, ever, 10));
}

TEST(Exponential, IsOneAtNothingAndFadesToNothing) {
  constexpr Microseconds time_constant = 33'333;
  const Exponential exponential(time_constant);
  for (Microseconds age = 0; age < 8 * time_constant; age += 1001)
    EXPECT_NEAR(exponential.after(age), std::exp(-static_cast<double>(age) / time_constant), 2e-4);
  EXPECT_EQ(exponential.after(Microseconds{1} << 60), 0);
}

int distance(const Colour& a, const Colour& b) {
  return std::max(
      {std::abs(a.red - b.red), std::abs(a.green - b.green), std::abs(a.blue - b.blue)});
}

TEST(Shades, BeginAndEndInTheColoursOfThePalette) {
  for (const auto name :
       {PaletteName::light, PaletteName::dark, PaletteName::grey, PaletteName::red_blue}) {
    const auto& colours = palette(name);
    const auto& scale = shades(name);
    EXPECT_LE(distance(scale[shade(0)], colours.none), 1);
    EXPECT_LE(distance(scale[shade(1)], colours.on), 1);
    EXPECT_LE(distance(scale[shade(-1)], colours.off), 1);
    EXPECT_LE(distance(scale[shade(-7)], colours.off), 1);
  }
}

TEST(Renderer, DrawsAnEnormousSensorSmaller) {
  Renderer renderer(16384, 16380, {});
  EXPECT_EQ(renderer.width(), 2731);
  EXPECT_EQ(renderer.height(), 2730);
  const Event events[] = {
      Event::at(0, 0, 1, Polarity::on), Event::at(16383, 16379, 2, Polarity::on),
      Event::at(600, 1205, 3, Polarity::off), Event::at(0, 16380, 4, Polarity::on)};
  EXPECT_EQ(renderer.add(events, 0).outside, 1U);
  const auto picture = draw(renderer, 0, 10);
  const auto at = [&](int x, int y) {
    return picture[static_cast<std::size_t>(y * (renderer.width() + 3) + x)];
  };
  const auto background = at(1, 1);
  EXPECT_NE(at(0, 0), background);
  EXPECT_EQ(at(2730, 2729), at(0, 0));
  EXPECT_NE(at(100, 200), background);
  EXPECT_NE(at(100, 200), at(0, 0));
  EXPECT_EQ(at(0, 2729), background);
  EXPECT_EQ(Renderer(3840, 2160, {}).width(), 3840);
}

}  // namespace
