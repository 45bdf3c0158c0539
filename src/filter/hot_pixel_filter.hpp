// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

namespace eventcamera {

struct PixelPosition {
  std::uint16_t x;  ///< column, from the left
  std::uint16_t y;  ///< row, from the top

  friend constexpr bool operator==(const PixelPosition&, const PixelPosition&) = default;
};

/// Parses a list of pixels, one per line: column and row, separated by blanks or a comma. Empty
/// lines and lines that begin with # are skipped. Throws std::invalid_argument with the offending
/// line.
std::vector<PixelPosition> parse_pixel_list(std::string_view text);

/// Writes a list that parse_pixel_list() reads.
std::string pixel_list_text(const std::vector<PixelPosition>& pixels);

/// Drops the events of hot pixels, which in the last learning period fired at `min_rate` or more
/// and at least `ratio` times as often as the median of their neighbours. 4 bytes per pixel.
class HotPixelFilter {
 public:
  struct Settings {
    bool learn = true;                            ///< if false, the hot pixels do not change
    Nanoseconds learning_period = 1'000'000'000;  ///< at least 1 us, rounded down to microseconds
    double min_rate = 10;                         ///< events per second
    double ratio = 5;                             ///< to the median of the neighbours
  };

  explicit HotPixelFilter(SensorSize sensor) : pixels_(sensor.width, sensor.height) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings);

  /// Restarts the learning period. Hot pixels stay: they belong to the sensor.
  void forget();

  /// Hot pixels in raster order.
  const std::vector<PixelPosition>& hot_pixels() const { return hot_; }
  /// Replaces the hot pixels. Those outside the sensor are ignored.
  void set_hot_pixels(std::vector<PixelPosition> pixels);

 private:
  static constexpr std::uint32_t hot_bit = std::uint32_t{1} << 31;
  static constexpr std::uint32_t count_bits = hot_bit - 1;

  void follow(const Settings& settings);
  void learn(double ratio);
  void clear_counts();
  std::uint32_t median_around(int x, int y) const;

  /// Events in the learning period, and whether the pixel is hot.
  Image<std::uint32_t> pixels_;
  std::vector<PixelPosition> frequent_;  ///< pixels that fired at the minimum rate or more
  std::vector<PixelPosition> hot_;
  static constexpr Microseconds never = std::numeric_limits<Microseconds>::max();
  Microseconds learning_end_ = never;
  // Settings of the learning period; when they change, another one begins.
  bool learns_ = false;
  Microseconds period_ = 0;
  std::uint32_t min_count_ = 0;
};
static_assert(Filter<HotPixelFilter>);

}  // namespace eventcamera
