// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "src/filter/filter.hpp"
#include "src/filter/stamped_pixels.hpp"

namespace eventcamera {

enum class FlickerMode {
  band_stop,  ///< drops flicker
  band_pass,  ///< keeps only flicker
};

/// Finds pixels that flicker with a frequency in a band, as the anti-flicker block of Prophesee's
/// sensors does for blocks of pixels. 8 bytes per pixel.
///
/// A phase lasts from the first event of one polarity to the first of the other. Each pixel has a
/// counter from 0 to max_threshold: a phase whose length fits a period in the band increments it,
/// any other phase decrements it, and the longest period without a change of polarity resets it. A
/// pixel starts to flicker when the counter reaches the start threshold, and stops when it falls
/// below the stop threshold.
class FlickerFilter {
 public:
  static constexpr unsigned max_threshold = 7;

  struct Settings {
    FlickerMode mode = FlickerMode::band_stop;
    unsigned min_frequency = 50;   ///< Hz, at least 1
    unsigned max_frequency = 520;  ///< Hz; raised to min_frequency if lower
    double duty_cycle = 0.5;       ///< share of ON phases, between 0 and 1
    unsigned start_threshold = 6;  ///< 1 to max_threshold
    unsigned stop_threshold = 4;   ///< from 1; lowered to start_threshold if higher
  };

  explicit FlickerFilter(SensorSize sensor) : pixels_(sensor) {}

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings) {
    const Phase off(settings, 1 - settings.duty_cycle);
    const Phase on(settings, settings.duty_cycle);
    const auto max_length = static_cast<Stamp>(1e6 / settings.min_frequency);
    const auto stop_threshold = std::min(settings.stop_threshold, settings.start_threshold);
    const unsigned start_threshold = settings.start_threshold;
    const bool keeps_flicker = settings.mode == FlickerMode::band_pass;
    return pixels_.keep_if(events, start, [=](const Event& event, Stamp now, Pixel* pixel) {
      const bool is_on = event.polarity() == Polarity::on;
      const Stamp length = now - pixel->began;
      if (length > max_length) {
        *pixel = {.began = now, .count = 0, .is_on = is_on, .flickers = false};
      } else if (is_on != pixel->is_on) {
        const bool fits = (pixel->is_on ? on : off).fits(length);
        const unsigned count = fits ? std::min(pixel->count + 1U, max_threshold)
                                    : std::max(pixel->count, std::uint8_t{1}) - 1U;
        const unsigned needed = pixel->flickers ? stop_threshold : start_threshold;
        *pixel = {.began = now,
                  .count = static_cast<std::uint8_t>(count),
                  .is_on = is_on,
                  .flickers = count >= needed};
      }
      return pixel->flickers == keeps_flicker;
    });
  }

  void forget() { pixels_.forget(); }

 private:
  /// Lengths of phases of one polarity.
  class Phase {
   public:
    Phase(const Settings& settings, double share)
        : min_(static_cast<Stamp>(share * 1e6 /
                                  std::max(settings.max_frequency, settings.min_frequency))),
          max_(static_cast<Stamp>(std::ceil(share * 1e6 / settings.min_frequency))) {}
    bool fits(Stamp length) const { return length >= min_ && length <= max_; }

   private:
    Stamp min_;
    Stamp max_;
  };

  struct Pixel {
    Stamp began = 0;  ///< of the phase
    std::uint8_t count = 0;
    bool is_on = false;
    bool flickers = false;

    void lower(std::uint64_t amount) { began = lowered(began, amount); }
  };

  StampedPixels<Pixel> pixels_;
};
static_assert(Filter<FlickerFilter>);

}  // namespace eventcamera
