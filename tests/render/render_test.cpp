// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "src/render/accumulator.hpp"
#include "tests/core/targets.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

const Event few_events[] = {Event::at(1, 0, 5, Polarity::off), Event::at(2, 0, 5, Polarity::on),
                            Event::at(0, 1, 6, Polarity::on), Event::at(0, 1, 7, Polarity::off)};

std::vector<int> draw(const PixelLayout& layout, PaletteName name) {
  Accumulator accumulator(3, 2);
  accumulator.add(few_events);
  const int stride = 3 * layout.bytes + 5;
  std::vector<std::byte> out(static_cast<std::size_t>(stride) * 2, std::byte{7});
  ThreadPool threads;
  accumulator.draw(palette(name), layout, out.data(), stride, threads);
  std::vector<int> bytes;
  for (const auto byte : out) bytes.push_back(std::to_integer<int>(byte));
  return bytes;
}

TEST(Accumulator, DrawsGrey) {
  EXPECT_EQ(draw({}, PaletteName::grey),
            (std::vector<int>{128, 0, 255, 7, 7, 7, 7, 7, 64, 128, 128, 7, 7, 7, 7, 7}));
}

/// Random events in buckets by step and band; a fraction `share` of the pixels fires per step.
StepBuckets events_by_chance(int width, int height, double share) {
  std::minstd_rand random(static_cast<unsigned>(width));
  std::bernoulli_distribution fires(share);
  std::bernoulli_distribution is_on(0.5);
  StepBuckets buckets;
  buckets.reset(3, 2);
  for (int step = 1; step <= 3; ++step)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (fires(random))
          buckets.bucket(step, 2 * y / height)
              .push_back(Event::at(x, y, 1, is_on(random) ? Polarity::on : Polarity::off));
  return buckets;
}

/// Draws the events pixel by pixel.
std::vector<std::byte> plainly_drawn(const EventBuckets& events, int width, int height, int stride,
                                     const Palette& palette, const PixelLayout& layout) {
  std::vector<std::byte> out(static_cast<std::size_t>(stride * height), std::byte{7});
  const auto list = scene::copy(events);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      bool on = false;
      bool off = false;
      for (const auto& event : list)
        if (event.x == x && event.y() == y) (event.polarity() == Polarity::on ? on : off) = true;
      const auto& colour = on && off ? palette.both
                           : on      ? palette.on
                           : off     ? palette.off
                                     : palette.none;
      auto* pixel = out.data() + y * stride + x * layout.bytes;
      std::fill_n(pixel, layout.bytes, std::byte{255});
      if (layout.bytes == 1) {
        *pixel =
            std::byte((299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000);
      } else {
        pixel[layout.red] = std::byte{colour.red};
        pixel[layout.green] = std::byte{colour.green};
        pixel[layout.blue] = std::byte{colour.blue};
      }
    }
  }
  return out;
}

const PixelLayout layouts[] = {{},
                               {.bytes = 3},
                               {.bytes = 4, .red = 2, .green = 1, .blue = 0},
                               {.bytes = 4, .red = 1, .green = 2, .blue = 3}};

/// Pictures narrower than any vector, as wide as a vector, and slightly wider.
void expect_pictures_as_drawn_plainly() {
  for (const int width : {1, 7, 15, 16, 17, 31, 32, 33, 63, 64, 65, 100, 129}) {
    for (const auto& layout : layouts) {
      for (const double share : {0.01, 0.3}) {
        constexpr int height = 5;
        const int stride = width * layout.bytes + 3;
        const auto events = events_by_chance(width, height, share);
        const auto& colours = palette(PaletteName::red_blue);
        Accumulator accumulator(width, height);
        ThreadPool threads;
        std::vector<std::byte> out(static_cast<std::size_t>(stride * height), std::byte{7});
        accumulator.add(events, threads);
        accumulator.draw(colours, layout, out.data(), stride, threads);
        ASSERT_EQ(out, plainly_drawn(events, width, height, stride, colours, layout))
            << width << " pixels of " << layout.bytes << " bytes, share " << share;
        accumulator.draw(colours, layout, out.data(), stride, threads);
        ASSERT_EQ(out, plainly_drawn(StepBuckets(), width, height, stride, colours, layout))
            << "the second of " << width << " pixels of " << layout.bytes << " bytes";
      }
    }
  }
}

TEST(Accumulator, DrawsTheSameWithAnyNumberOfThreads) {
  constexpr int width = 70;
  constexpr int height = 5 * rows_per_band + 3;
  StepBuckets events;
  events.reset(3, band_count(height));
  for (int step = 1; step <= 3; ++step)
    for (int y = 0; y < height; ++y)
      for (int x = step + y; x < width; x += step)
        events.bucket(step, y / rows_per_band)
            .push_back(Event::at(x, y, step, x % 3 == 0 ? Polarity::on : Polarity::off));
  ThreadPool threads;
  const auto drawn = [&] {
    Accumulator accumulator(width, height);
    accumulator.add(events, threads);
    std::vector<std::byte> out(std::size_t{width} * height);
    accumulator.draw(palette(PaletteName::grey), {}, out.data(), width, threads);
    return out;
  };
  const auto expected = drawn();
  for (const int max_threads : {1, 2, 0}) {
    threads.set_threads(max_threads);
    EXPECT_EQ(drawn(), expected) << max_threads << " threads";
  }
}

TEST(Accumulator, DrawsThePlainPictureOnEveryTarget) {
  targets::for_each([](const char* target) {
    SCOPED_TRACE(target);
    expect_pictures_as_drawn_plainly();
  });
}

TEST(Palette, TellsFourKindsOfPixelApartInGreyToo) {
  for (const auto name : {PaletteName::light, PaletteName::dark, PaletteName::grey,
                          PaletteName::red_blue, PaletteName::viridis, PaletteName::magma}) {
    auto grey = draw({}, name);
    std::vector<int> kinds = {grey[0], grey[1], grey[2], grey[8]};
    std::ranges::sort(kinds);
    for (int i = 1; i < 4; ++i) EXPECT_GE(kinds[i] - kinds[i - 1], 20);
  }
}

}  // namespace
