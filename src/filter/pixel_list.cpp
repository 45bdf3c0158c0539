// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/pixel_list.hpp"

#include <charconv>
#include <stdexcept>
#include <system_error>

#include "src/core/sensor_size.hpp"

namespace eventcamera {

static std::string_view without_first(std::string_view text, std::string_view characters) {
  text.remove_prefix(std::min(text.find_first_not_of(characters), text.size()));
  return text;
}

/// Parses and removes a number at the front of `line`; max_side if it is missing or too large.
static int parse_number(std::string_view& line) {
  int number = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
  if (error != std::errc() || number < 0 || number >= max_side) return max_side;
  line.remove_prefix(static_cast<std::size_t>(end - line.data()));
  return number;
}

std::vector<PixelPosition> parse_pixel_list(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  std::vector<PixelPosition> pixels;
  for (int number = 1; !text.empty(); ++number) {
    auto line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    line = without_first(line, blanks);
    if (line.empty() || line.front() == '#') continue;
    const int x = parse_number(line);
    line = without_first(line, " \t,");
    const int y = parse_number(line);
    if (x == max_side || y == max_side || !without_first(line, blanks).empty())
      throw std::invalid_argument("line " + std::to_string(number) +
                                  " is not a column and a row of a pixel");
    pixels.push_back({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)});
  }
  return pixels;
}

std::string pixel_list_text(const std::vector<PixelPosition>& pixels) {
  std::string text = "# Hot pixels: column and row\n";
  for (const auto& pixel : pixels)
    text += std::to_string(pixel.x) + ' ' + std::to_string(pixel.y) + '\n';
  return text;
}

}  // namespace eventcamera
