// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/hot_pixel_filter.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "src/filter/filter.hpp"

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

void HotPixelFilter::follow(const Settings& settings) {
  const Microseconds period = settings.learning_period / 1000;
  const auto min_count = static_cast<std::uint32_t>(std::clamp(
      std::ceil(settings.min_rate * static_cast<double>(period) / 1e6), 1.0, double{count_bits}));
  if (settings.learn == learns_ && period == period_ && min_count == min_count_) return;
  forget();
  learns_ = settings.learn;
  period_ = period;
  min_count_ = min_count;
}

LabelledEvents HotPixelFilter::filter(LabelledEvents events, Microseconds start,
                                      const Settings& settings) {
  follow(settings);
  if (learns_ && learning_end_ == never && !events.events.empty())
    learning_end_ = start + events.events.front().t + period_;
  const auto pixel_of = [origin = reinterpret_cast<std::byte*>(pixels_.row(0)),
                         stride = pixels_.stride()](const Event& event) {
    return reinterpret_cast<std::uint32_t*>(origin + event.y() * stride) + event.x;
  };
  const auto prefetch = [pixel_of](const Event& event) { __builtin_prefetch(pixel_of(event), 1); };
  const std::uint32_t counted = learns_ ? 1 : 0;
  const std::uint32_t min_count = min_count_;
  Microseconds end = learning_end_;
  return keep_if_prefetched(events, prefetch, [&](const Event& event) {
    const Microseconds time = start + event.t;
    if (time >= end) [[unlikely]] {
      learn(settings.ratio);
      // Periods without any event say nothing about hot pixels.
      learning_end_ += (1 + (time - learning_end_) / period_) * period_;
      end = learning_end_;
    }
    std::uint32_t& pixel = *pixel_of(event);
    pixel += counted;
    if ((pixel & count_bits) == min_count) [[unlikely]]
      frequent_.push_back({event.x, static_cast<std::uint16_t>(event.y())});
    return (pixel & hot_bit) == 0;
  });
}

/// Median event count of the neighbours of a pixel; the upper one of an even number.
std::uint32_t HotPixelFilter::median_around(int x, int y) const {
  std::array<std::uint32_t, 8> counts;
  auto end = counts.begin();
  for (int row = std::max(y - 1, 0); row <= std::min(y + 1, pixels_.height() - 1); ++row)
    for (int column = std::max(x - 1, 0); column <= std::min(x + 1, pixels_.width() - 1); ++column)
      if (row != y || column != x) *end++ = pixels_.at(column, row) & count_bits;
  if (end == counts.begin()) return 0;
  const auto middle = counts.begin() + (end - counts.begin()) / 2;
  std::nth_element(counts.begin(), middle, end);
  return *middle;
}

void HotPixelFilter::learn(double ratio) {
  std::vector<PixelPosition> hot;
  for (const auto& [x, y] : frequent_)
    if ((pixels_.at(x, y) & count_bits) >= ratio * median_around(x, y)) hot.push_back({x, y});
  std::ranges::sort(hot, {}, [](const auto& pixel) { return std::pair(pixel.y, pixel.x); });
  clear_counts();
  set_hot_pixels(std::move(hot));
}

void HotPixelFilter::clear_counts() {
  frequent_.clear();
  for (int y = 0; y < pixels_.height(); ++y) std::fill_n(pixels_.row(y), pixels_.width(), 0U);
  for (const auto& pixel : hot_) pixels_.at(pixel.x, pixel.y) = hot_bit;
}

void HotPixelFilter::forget() {
  clear_counts();
  learning_end_ = never;
}

void HotPixelFilter::set_hot_pixels(std::vector<PixelPosition> pixels) {
  for (const auto& pixel : hot_) pixels_.at(pixel.x, pixel.y) &= count_bits;
  std::erase_if(pixels, [this](const PixelPosition& pixel) {
    return pixel.x >= pixels_.width() || pixel.y >= pixels_.height();
  });
  hot_ = std::move(pixels);
  for (const auto& pixel : hot_) pixels_.at(pixel.x, pixel.y) |= hot_bit;
}

}  // namespace eventcamera
