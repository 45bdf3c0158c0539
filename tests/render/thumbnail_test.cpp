// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/render/palette.hpp"
#include "src/render/thumbnail.hpp"

namespace {

using namespace eventcamera;

/// Rows of a picture: a letter per pixel, '.' none, 'o' OFF, 'x' ON.
std::vector<std::string> rows_of(const RgbPicture& picture) {
  const auto& colours = palette(PaletteName::dark);
  std::vector<std::string> rows;
  for (int y = 0; y < picture.height(); ++y) {
    std::string row;
    for (int x = 0; x < picture.width(); ++x) {
      const auto* pixel = picture.row(y) + std::ptrdiff_t{3} * x;
      const auto is = [pixel](const Colour& colour) {
        return pixel[0] == colour.red && pixel[1] == colour.green && pixel[2] == colour.blue;
      };
      row += is(colours.none) ? '.' : is(colours.off) ? 'o' : is(colours.on) ? 'x' : '?';
    }
    rows.push_back(row);
  }
  return rows;
}

/// Events in raster order on a 100 x 100 sensor, one per `spacing` microseconds.
std::vector<Event> raster(std::uint32_t count, std::uint32_t spacing) {
  std::vector<Event> events;
  for (std::uint32_t i = 0; i < count; ++i)
    events.push_back(
        Event::at(static_cast<int>(i) % 100, static_cast<int>(i) / 100, i * spacing, Polarity::on));
  return events;
}

/// Number of pixels with events.
std::size_t fired(const Thumbnail& thumbnail) {
  std::size_t count = 0;
  for (const auto& row : rows_of(thumbnail.draw()))
    for (const char pixel : row) count += pixel != '.';
  return count;
}

TEST(Thumbnail, ShowsEachEventOfALargerSensor) {
  Thumbnail thumbnail({1000, 500}, 4);
  thumbnail.add(
      std::vector{Event::at(249, 0, 0, Polarity::on), Event::at(999, 499, 0, Polarity::off)}, 0);
  EXPECT_EQ(rows_of(thumbnail.draw()), (std::vector<std::string>{"x...", "...o"}));
}

TEST(Thumbnail, ShowsTheLastPolarity) {
  Thumbnail thumbnail({8, 8}, 4);
  thumbnail.add(std::vector{Event::at(0, 0, 1, Polarity::on), Event::at(1, 1, 1, Polarity::off)},
                7);
  EXPECT_EQ(rows_of(thumbnail.draw())[0], "o...");
}

TEST(Thumbnail, FitsTheSensor) {
  const auto size_of = [](SensorSize sensor) {
    const auto picture = Thumbnail(sensor, 256).draw();
    return std::pair(picture.width(), picture.height());
  };
  EXPECT_EQ(size_of({3, 2}), std::pair(3, 2));
  EXPECT_EQ(size_of({max_side, 1}), std::pair(256, 1));
}

TEST(Thumbnail, SkipsEventsOutsideTheSensor) {
  Thumbnail thumbnail({100, 100}, 256);
  thumbnail.add(std::vector{Event::at(100, 0, 0, Polarity::on), Event::at(0, 100, 0, Polarity::on),
                            Event::at(65535, 32767, 0, Polarity::on)},
                0);
  EXPECT_EQ(fired(thumbnail), 0U);
}

TEST(Thumbnail, EndsWhenEnoughPixelsFired) {
  Thumbnail thumbnail({100, 100}, 100);
  thumbnail.add(raster(800, 1), 0);
  EXPECT_FALSE(thumbnail.is_full());
  thumbnail.add(raster(10000, 1), 800);
  EXPECT_TRUE(thumbnail.is_full());
  EXPECT_EQ(fired(thumbnail), 801U);
}

TEST(Thumbnail, DoesNotEndBetweenEventsOfTheSameTime) {
  Thumbnail thumbnail({100, 100}, 100);
  thumbnail.add(raster(5000, 0), 0);
  EXPECT_EQ(fired(thumbnail), 5000U);
}

TEST(Thumbnail, DoesNotEndWhileOnlyAFewPixelsFire) {
  Thumbnail thumbnail({100, 100}, 100);
  for (Microseconds start = 0; start < 100000; start += 100) thumbnail.add(raster(100, 1), start);
  EXPECT_FALSE(thumbnail.is_full());
}

TEST(Thumbnail, IsBetterIfItShowsMoreOrTheSameSooner) {
  const auto of = [](const std::vector<Event>& events) {
    Thumbnail thumbnail({100, 100}, 100);
    thumbnail.add(events, 5);
    return thumbnail;
  };
  const auto empty = of({});
  const auto few = of(raster(10, 1));
  const auto slow = of(raster(1000, 2));
  const auto fast = of(raster(1000, 1));
  EXPECT_TRUE(few.is_better_than(empty));
  EXPECT_TRUE(slow.is_better_than(few));
  EXPECT_TRUE(fast.is_better_than(slow));
  EXPECT_FALSE(slow.is_better_than(fast));
  EXPECT_FALSE(fast.is_better_than(fast));
}

}  // namespace
