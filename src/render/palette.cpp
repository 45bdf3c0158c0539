// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/palette.hpp"

#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace eventcamera {
namespace {

constexpr Palette light = {
    .none = {255, 255, 255}, .off = {28, 34, 48}, .on = {64, 128, 208}, .both = {46, 81, 128}};
constexpr Palette dark = {
    .none = {28, 34, 48}, .off = {64, 128, 208}, .on = {240, 244, 250}, .both = {152, 186, 230}};
constexpr Palette grey = {
    .none = {128, 128, 128}, .off = {0, 0, 0}, .on = {255, 255, 255}, .both = {64, 64, 64}};
constexpr Palette red_blue = {
    .none = {255, 255, 255}, .off = {232, 56, 56}, .on = {32, 64, 224}, .both = {110, 0, 110}};

/// Colour map: one polynomial over [0, 1] each for red, green and blue.
using Scale = std::array<std::array<double, 7>, 3>;

// Least-squares fits to Matplotlib's colour maps of these names, accurate to 6 of 255.
constexpr Scale viridis = {{{68.5, 51.3, -180.0, -1122.9, 1945.3, 564.9, -1074.8},
                            {1.1, 362.5, 17.7, -1376.2, 3504.7, -3458.6, 1179.7},
                            {84.3, 354.9, 104.9, -5494.1, 15897.8, -18220.6, 7308.8}}};
constexpr Scale magma = {{{0.2, 59.6, 2071.5, -6573.2, 12027.1, -11537.9, 4205.4},
                          {-0.2, 161.0, -684.6, 2496.2, -4653.8, 4958.8, -2025.8},
                          {2.1, 529.5, 874.6, -6081.6, 7521.4, -2254.8, -400.0}}};

std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

Colour colour_at(const Scale& scale, double x) {
  const auto value = [x](const std::array<double, 7>& polynomial) {
    double sum = 0;
    for (std::size_t i = polynomial.size(); i-- > 0;) sum = sum * x + polynomial[i];
    return to_byte(sum);
  };
  return {value(scale[0]), value(scale[1]), value(scale[2])};
}

Palette palette_of(const Scale& scale) {
  return {.none = colour_at(scale, 0),
          .off = colour_at(scale, 0.45),
          .on = colour_at(scale, 1),
          .both = colour_at(scale, 0.75)};
}

double to_linear(std::uint8_t byte) {
  const double value = byte / 255.0;
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double from_linear(double value) {
  return 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055);
}

/// Colour in the perceptually uniform space Oklab (B. Ottosson, 2020).
struct Oklab {
  double l, a, b;

  static Oklab of(const Colour& colour) {
    const double red = to_linear(colour.red);
    const double green = to_linear(colour.green);
    const double blue = to_linear(colour.blue);
    const double l = std::cbrt(0.4122214708 * red + 0.5363325363 * green + 0.0514459929 * blue);
    const double m = std::cbrt(0.2119034982 * red + 0.6806995451 * green + 0.1073969566 * blue);
    const double s = std::cbrt(0.0883024619 * red + 0.2817188376 * green + 0.6299787005 * blue);
    return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
            1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
            0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
  }

  Colour colour() const {
    const auto cube = [](double x) { return x * x * x; };
    const double long_cone = cube(l + 0.3963377774 * a + 0.2158037573 * b);
    const double middle_cone = cube(l - 0.1055613458 * a - 0.0638541728 * b);
    const double short_cone = cube(l - 0.0894841775 * a - 1.2914855480 * b);
    const auto byte = [&](double of_long, double of_middle, double of_short) {
      return to_byte(
          from_linear(of_long * long_cone + of_middle * middle_cone + of_short * short_cone));
    };
    return {byte(4.0767416621, -3.3077115913, 0.2309699292),
            byte(-1.2684380046, 2.6097574011, -0.3413193965),
            byte(-0.0041960863, -0.7034186147, 1.7076147010)};
  }
};

Colour between(const Colour& from, const Colour& to, double share) {
  const auto a = Oklab::of(from);
  const auto b = Oklab::of(to);
  const auto mix = [share](double x, double y) { return x + share * (y - x); };
  return Oklab{mix(a.l, b.l), mix(a.a, b.a), mix(a.b, b.b)}.colour();
}

/// Calls `colour_of` for the value of each shade.
template <class ColourOf>
Shades make_shades(const ColourOf& colour_of) {
  Shades made;
  for (int i = 0; i < 256; ++i)
    made[static_cast<std::size_t>(i)] = colour_of(std::max(-1.0, (i - 128) / 127.0));
  return made;
}

Shades shades_of(const Palette& palette) {
  return make_shades([&palette](double value) {
    return between(palette.none, value < 0 ? palette.off : palette.on, std::abs(value));
  });
}

Shades shades_of(const Scale& scale) {
  return make_shades([&scale](double value) { return colour_at(scale, std::abs(value)); });
}

}  // namespace

// In the order of PaletteName.
const Palette& palette(PaletteName name) {
  static const std::array palettes = {
      light, dark, grey, red_blue, palette_of(viridis), palette_of(magma)};
  return palettes[static_cast<std::size_t>(name)];
}

const Shades& shades(PaletteName name) {
  static const std::array all_shades = {shades_of(light),    shades_of(dark),    shades_of(grey),
                                        shades_of(red_blue), shades_of(viridis), shades_of(magma)};
  return all_shades[static_cast<std::size_t>(name)];
}

}  // namespace eventcamera
