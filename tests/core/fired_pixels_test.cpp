// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/fired_pixels.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/core/targets.hpp"

namespace {

using namespace eventcamera;

/// Pixels of which about one in `rarity` fires, and their events in raster order.
struct Fired {
  explicit Fired(int rarity) {
    std::minstd_rand random(static_cast<unsigned>(rarity));
    pixels.begin(4711);
    for (int y = 0; y < 32768; y += 2339) {
      for (int x = y % 7; x < 1000; x += 64) {
        std::uint64_t fired = 0;
        std::uint64_t on = 0;
        for (int i = 0; i < 64; ++i) {
          const std::uint64_t bit = std::uint64_t{1} << i;
          const bool is_on = random() % 64 < 32;
          if (is_on) on |= bit;
          if (static_cast<int>(random() >> 8) % rarity != 0) continue;
          fired |= bit;
          events.push_back(Event::at(x + i, y, 4711, is_on ? Polarity::on : Polarity::off));
        }
        pixels.add(x, y, fired, on);
      }
    }
  }

  FiredPixels pixels;
  std::vector<Event> events;
};

TEST(FiredPixels, AreWrittenAsTheirEventsOnEveryTarget) {
  targets::for_each([](const char* target) {
    for (const int rarity : {1, 2, 9, 100, 5000}) {
      const Fired fired(rarity);
      ASSERT_EQ(fired.pixels.size(), fired.events.size());
      std::vector<Event> written(fired.events.size() + 1);
      const auto past_the_end = Event::at(1, 2, 3, Polarity::on);
      written.back() = past_the_end;
      fired.pixels.write_to(written.data());
      EXPECT_EQ(written.back(), past_the_end) << target << ", one in " << rarity;
      written.pop_back();
      EXPECT_EQ(written, fired.events) << target << ", one in " << rarity;

      std::vector<Event> visited;
      fired.pixels.visit([&](std::span<const Event> events) {
        visited.insert(visited.end(), events.begin(), events.end());
      });
      EXPECT_EQ(visited, fired.events) << target << ", one in " << rarity;
    }
  });
}

TEST(FiredPixels, BeginAgain) {
  Fired fired(3);
  fired.pixels.begin(1);
  EXPECT_EQ(fired.pixels.size(), 0U);
  fired.pixels.write_to(nullptr);
  fired.pixels.add(65530, 32767, 0b100001, 0b100000);
  EXPECT_EQ(fired.pixels.on_size(), 1U);
  std::vector<Event> events(2);
  fired.pixels.write_to(events.data());
  EXPECT_EQ(events, (std::vector{Event::at(65530, 32767, 1, Polarity::off),
                                 Event::at(65535, 32767, 1, Polarity::on)}));
}

}  // namespace
