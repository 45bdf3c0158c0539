// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event_buckets.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/dense.hpp"
#include "src/simulate/gradient_bound.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// The frames between two frames, and what makes a pixel fire on its way through them.
template <class Pixel>
struct Path {
  Warp<Pixel> warp;
  ImageView<Flow> flow;
  Interpolation interpolation;
  StepTimes steps;
  Thresholds thresholds;
};

/// Takes all pixels through all steps, each pixel's whole path at once, with no frame in between
/// written down.
///
/// Most pixels cannot fire before the last step, and that can be known beforehand, exactly: a step
/// of (dx, dy) pixels changes a bilinear sample by no more than |dx| gx + |dy| gy, where gx and gy
/// are the largest differences of neighbours within reach. Tiles of pixels for which that does not
/// exceed the thresholds skip to the last step.
class PathWalker {
 public:
  /// Replaces what `events` held. The frames of the 8-bit warp must be Planes: SIMD code reads
  /// behind their ends.
  void fire(const Path<std::uint8_t>& path, ThreadPool& threads, EventBuckets& events);
  void fire(const Path<std::uint16_t>& path, ThreadPool& threads, EventBuckets& events);

 private:
  GradientBound gradient_bound_;
  Image<std::uint16_t> last_pairs_;  ///< the last frame, each pixel beside the one below it
};

}  // namespace eventcamera
