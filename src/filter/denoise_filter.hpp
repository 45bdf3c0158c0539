// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "src/core/label.hpp"
#include "src/filter/filter.hpp"
#include "src/filter/stamped_pixels.hpp"

namespace eventcamera {

/// The double window filter (Guo and Delbruck, "Low Cost and Latency Event Camera Background
/// Activity Denoising", TPAMI 2022): stores the positions of the last 36 signal events, and of the
/// last 36 noise events.
class DoubleWindow {
 public:
  DoubleWindow() { clear(); }

  /// Keeps signal: events within `distance` pixels, across plus down, of one in either window.
  LabelledEvents filter(LabelledEvents events, unsigned distance);

  void clear();

  /// Positions of events, padded to whole vectors with positions far from all others.
  struct Window {
    static constexpr std::size_t size = 36;

    std::array<std::int16_t, 48> x;
    std::array<std::int16_t, 48> y;
    std::size_t next;

    void add(const Event& event) {
      x[next] = static_cast<std::int16_t>(event.x);
      y[next] = static_cast<std::int16_t>(event.y());
      next = next + 1 == size ? 0 : next + 1;
    }
  };

 private:
  Window signal_;
  Window noise_;
};

/// How noise is distinguished from signal. The neighbours of a pixel do not include the pixel.
enum class DenoiseMethod {
  /// Background activity filter (Delbruck 2008): one of 8 neighbours fired within the correlation
  /// time.
  baf,
  /// Spatio-temporal correlation filter (Guo and Delbruck 2022): at least min_neighbours fired.
  stcf,
  /// The weights of 24 neighbours add up to the threshold: a weight falls from 1 to 0 over the
  /// correlation time, with the age of the last event of equal polarity.
  time_kernel,
  /// Double window filter (Guo and Delbruck 2022), see DoubleWindow.
  dwf,
};

/// Drops events with too little support by earlier events, dropped ones included. 4 bytes per
/// pixel, 8 if polarities must match; none with dwf.
class DenoiseFilter {
 public:
  struct Settings {
    DenoiseMethod method = DenoiseMethod::stcf;
    /// At most max_correlation_time, 0 = the method's default.
    Nanoseconds correlation_time = 0;
    unsigned min_neighbours = 2;  ///< of stcf: 1 to 8
    /// In baf and stcf: whether only events of equal polarity support each other.
    bool match_polarity = false;
    double threshold = 3;          ///< of time_kernel: 0 to 24
    unsigned search_distance = 9;  ///< of dwf: pixels across plus pixels down
  };

  /// Keeps the sum of time_kernel within 32 bits.
  static constexpr Nanoseconds max_correlation_time = 50'000'000'000;

  /// Radius of the neighbourhood of time_kernel, pixels.
  static constexpr int kernel_radius = 2;

  static Nanoseconds default_correlation_time(DenoiseMethod method);

  explicit DenoiseFilter(SensorSize sensor) : sensor_(sensor) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings);

  void forget();

 private:
  StampedPixels<Stamp>& pixels(int margin, bool match_polarity);

  SensorSize sensor_;
  int margin_ = 0;
  bool match_polarity_ = false;
  std::optional<StampedPixels<Stamp>> pixels_;  ///< made when first needed
  DoubleWindow window_;
};
static_assert(Filter<DenoiseFilter>);

}  // namespace eventcamera
