// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/palette.hpp"

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

}  // namespace

const Palette& palette(PaletteName name) {
  switch (name) {
    case PaletteName::light:
      return light;
    case PaletteName::dark:
      return dark;
    case PaletteName::grey:
      return grey;
    case PaletteName::red_blue:
      return red_blue;
  }
  return dark;
}

}  // namespace eventcamera
