// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/event/event_buckets.hpp"
#include "src/event/step_times.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/parallel/thread_pool.hpp"
#include "src/simulate/dense.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// The frames between two frames, and what makes a pixel fire on its way through them.
template <class Pixel>
struct Path {
  Warp<Pixel> warp;
  PlaneView<Flow> flow;
  Interpolation interpolation;
  StepTimes steps;
  Thresholds thresholds;
};

/// Takes all pixels through all steps, each pixel's whole path at once, with no frame in between
/// written down. Replaces what `events` held.
/// The frames of the 8-bit warp must be Planes: SIMD code reads behind their ends.
void fire_along(const Path<std::uint8_t>& path, ThreadPool& threads, EventBuckets& events);
void fire_along(const Path<std::uint16_t>& path, ThreadPool& threads, EventBuckets& events);

}  // namespace eventcamera
