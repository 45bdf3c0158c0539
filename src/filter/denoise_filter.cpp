// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/denoise_filter.hpp"

#include <cmath>

#include "src/filter/neighbour_support.hpp"

namespace eventcamera {

Nanoseconds DenoiseFilter::default_correlation_time(DenoiseMethod method) {
  switch (method) {
    case DenoiseMethod::baf:
      return 2'000'000;
    case DenoiseMethod::stcf:
      return 25'000'000;
    case DenoiseMethod::time_kernel:
      return 32'000'000;
    case DenoiseMethod::dwf:
      break;
  }
  return 0;
}

LabelledEvents DenoiseFilter::filter(LabelledEvents events, Microseconds start,
                                     const Settings& settings) {
  if (settings.method == DenoiseMethod::dwf) {
    pixels_.reset();
    return window_.filter(events, settings.search_distance);
  }
  window_.clear();
  const Stamp correlation_time =
      in_stamps(settings.correlation_time != 0 ? settings.correlation_time
                                               : default_correlation_time(settings.method));
  if (settings.method == DenoiseMethod::time_kernel) {
    const auto needed =
        static_cast<std::uint32_t>(std::ceil(settings.threshold * correlation_time));
    return pixels(kernel_radius, true).keep_batches(events, start, [&](const auto& batch) {
      find_kernel_support(batch, correlation_time, needed);
    });
  }
  const unsigned needed = settings.method == DenoiseMethod::baf ? 1 : settings.min_neighbours;
  return pixels(1, settings.match_polarity).keep_batches(events, start, [&](const auto& batch) {
    find_neighbour_support(batch, correlation_time, needed);
  });
}

StampedPixels<Stamp>& DenoiseFilter::pixels(int margin, bool match_polarity) {
  if (!pixels_ || margin != margin_ || match_polarity != match_polarity_) {
    pixels_.reset();  // first, for its memory
    pixels_.emplace(sensor_, margin,
                    match_polarity ? CellsPerPixel::one_per_polarity : CellsPerPixel::one);
    margin_ = margin;
    match_polarity_ = match_polarity;
  }
  return *pixels_;
}

void DenoiseFilter::forget() {
  if (pixels_) pixels_->forget();
  window_.clear();
}

}  // namespace eventcamera
