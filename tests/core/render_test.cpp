// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "src/picture/luma.hpp"
#include "src/render/accumulator.hpp"

namespace {

using namespace eventcamera;

const Event events[] = {Event::at(1, 0, 5, Polarity::off), Event::at(2, 0, 5, Polarity::on),
                        Event::at(0, 1, 6, Polarity::on), Event::at(0, 1, 7, Polarity::off)};

std::vector<int> draw(const PixelLayout& layout, PaletteName name) {
  Accumulator accumulator(3, 2);
  accumulator.add(events);
  const int stride = 3 * layout.bytes + 5;
  std::vector<std::byte> out(static_cast<std::size_t>(stride) * 2, std::byte{7});
  accumulator.draw(palette(name), layout, out.data(), stride);
  std::vector<int> bytes;
  for (const auto byte : out) bytes.push_back(std::to_integer<int>(byte));
  return bytes;
}

TEST(Accumulator, DrawsGrey) {
  EXPECT_EQ(draw({}, PaletteName::grey),
            (std::vector<int>{128, 0, 255, 7, 7, 7, 7, 7, 64, 128, 128, 7, 7, 7, 7, 7}));
}

TEST(Accumulator, DrawsColoursWhereTheLayoutHasThem) {
  const auto& colours = palette(PaletteName::red_blue);
  const auto bytes = draw({.bytes = 4, .red = 2, .green = 1, .blue = 0}, PaletteName::red_blue);
  const auto pixel = [&](int x, int y) {
    const auto* p = bytes.data() + y * 17 + x * 4;
    return std::array{p[2], p[1], p[0], p[3]};
  };
  const auto is = [](const Colour& colour) {
    return std::array<int, 4>{colour.red, colour.green, colour.blue, 255};
  };
  EXPECT_EQ(pixel(0, 0), is(colours.none));
  EXPECT_EQ(pixel(1, 0), is(colours.off));
  EXPECT_EQ(pixel(2, 0), is(colours.on));
  EXPECT_EQ(pixel(0, 1), is(colours.both));
  EXPECT_EQ(bytes[12], 7);  // nothing beyond the row
}

TEST(Accumulator, BeginsAnewAfterDrawing) {
  Accumulator accumulator(3, 2);
  accumulator.add(events);
  std::vector<std::byte> out(6);
  accumulator.draw(palette(PaletteName::grey), {}, out.data(), 3);
  accumulator.draw(palette(PaletteName::grey), {}, out.data(), 3);
  EXPECT_TRUE(std::ranges::all_of(out, [](std::byte b) { return b == std::byte{128}; }));
}

TEST(Palette, TellsFourKindsOfPixelApartInGreyToo) {
  for (const auto name :
       {PaletteName::light, PaletteName::dark, PaletteName::grey, PaletteName::red_blue}) {
    auto grey = draw({}, name);
    std::vector<int> kinds = {grey[0], grey[1], grey[2], grey[8]};
    std::ranges::sort(kinds);
    for (int i = 1; i < 4; ++i) EXPECT_GE(kinds[i] - kinds[i - 1], 20);
  }
}

TEST(Luma, IsGatheredFromPackedPictures) {
  const std::uint8_t packed[] = {1, 90, 2, 91, 3, 92, 0, 0, 4, 93, 5, 94, 6, 95, 0, 0};
  Plane<std::uint8_t> luma(3, 2);
  unpack_luma(packed, 8, luma);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(luma.at(i % 3, i / 3), i + 1);
}

}  // namespace
