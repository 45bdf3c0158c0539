// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/accumulator.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace eventcamera {
namespace {

using PixelBytes = std::array<std::byte, 4>;

/// Brightness as BT.601 weighs it.
std::uint8_t luma(const Colour& colour) {
  return static_cast<std::uint8_t>(
      (299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000);
}

PixelBytes encode(const Colour& colour, const PixelLayout& layout) {
  if (layout.bytes == 1) return {std::byte{luma(colour)}};
  PixelBytes pixel;
  pixel.fill(std::byte{255});
  pixel[static_cast<std::size_t>(layout.red)] = std::byte{colour.red};
  pixel[static_cast<std::size_t>(layout.green)] = std::byte{colour.green};
  pixel[static_cast<std::size_t>(layout.blue)] = std::byte{colour.blue};
  return pixel;
}

template <int bytes>
void draw_row(std::uint8_t* fired, int width, const std::array<PixelBytes, 4>& pixels,
              std::byte* out) {
  for (int x = 0; x < width; ++x)
    std::memcpy(out + std::ptrdiff_t{x} * bytes, pixels[fired[x]].data(), bytes);
  std::fill_n(fired, width, std::uint8_t{0});
}

}  // namespace

void Accumulator::add(std::span<const Event> events) {
  for (const auto& event : events)
    fired_.at(event.x, event.y()) |= event.polarity() == Polarity::on ? 2 : 1;
}

void Accumulator::draw(const Palette& palette, const PixelLayout& layout, std::byte* out,
                       std::ptrdiff_t stride) {
  const std::array<PixelBytes, 4> pixels = {encode(palette.none, layout),
                                            encode(palette.off, layout), encode(palette.on, layout),
                                            encode(palette.both, layout)};
  const auto row = layout.bytes == 1 ? draw_row<1> : layout.bytes == 3 ? draw_row<3> : draw_row<4>;
  for (int y = 0; y < fired_.height(); ++y)
    row(fired_.row(y), fired_.width(), pixels, out + y * stride);
}

}  // namespace eventcamera
