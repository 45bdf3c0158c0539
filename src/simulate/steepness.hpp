// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/parallel/thread_pool.hpp"
#include "src/picture/plane.hpp"
#include "src/simulate/bands.hpp"

namespace eventcamera {

/// How much neighbouring pixels of a picture differ at most, tile by tile. A tile is as high as a
/// band, and as wide.
class Steepness {
 public:
  static constexpr int tile = rows_per_band;

  /// `picture` must be a Plane: SIMD code reads behind its end.
  void measure(const PlaneView<std::uint8_t>& picture, ThreadPool& threads);

  struct Bound {
    int x;  ///< of a pixel and the one to its right, grey levels
    int y;  ///< of a pixel and the one below it
  };

  /// The largest of the pixels [left, right] x [top, bottom], which may reach beyond the picture.
  Bound within(int left, int top, int right, int bottom) const;

 private:
  Plane<std::uint8_t> x_;
  Plane<std::uint8_t> y_;
};

}  // namespace eventcamera
