// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"

namespace eventcamera {

/// PointTracker's tracks of these points.
inline std::vector<Track> tracks_between(const Image<std::uint8_t>& from,
                                         const Image<std::uint8_t>& to,
                                         const std::vector<Point>& points, int block_side,
                                         int thread_count = 1) {
  ThreadPool threads;
  threads.set_threads(thread_count);
  PointTracker tracker(block_side);
  tracker.push(from.view(), threads);
  tracker.push(to.view(), threads);
  const auto tracks = tracker.track(points, threads);
  return {tracks.begin(), tracks.end()};
}

}  // namespace eventcamera
