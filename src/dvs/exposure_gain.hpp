// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Minimum luma of a saturated pixel: the white of narrow-range video.
inline int saturated_luma(int white) {
  return static_cast<int>(std::ceil(white * 235 / 255.0));
}

/// Estimates the gain by which a frame camera changed its exposure: event cameras do not see it.
///
/// An exposure changes all light by the same factor; motion, a shadow or a lamp changes some places
/// more than others. So the gain is the median of the gains of 4x4 regions, each of which is the
/// median of its blocks of 8x8 pixels. It is valid if at least eight regions have a gain, and three
/// quarters of them agree with it. The reference implementation is `reference::exposure_gain()`.
class ExposureGain {
 public:
  /// Smaller gains are within the error of the estimate, larger ones too sudden for an exposure.
  static constexpr double min_gain = 1.01;
  static constexpr double max_gain = 1.25;

  /// For luma of 8 to 16 bits.
  ExposureGain(int bits, bool linear_light);

  /// Returns the gain from one frame to the next; 1 if it is not valid. The same for any number of
  /// threads.
  template <class Pixel>
  double between(const ImageView<Pixel>& last, const ImageView<Pixel>& now, ThreadPool& threads);

 private:
  std::vector<std::uint16_t> light_;  ///< by luma; 0 if too dark, or saturated
  std::vector<double> gains_;         ///< logarithms, by block; NaN if unknown
};

/// Scales a frame to `gain` times its exposure. Saturated pixels stay saturated.
template <class Pixel>
void expose(Image<Pixel>& frame, int bits, bool linear_light, double gain, ThreadPool& threads);

}  // namespace eventcamera
