// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "src/flow/dense_flow.hpp"

namespace eventcamera {

struct Point {
  int x;
  int y;
};

/// Where a tracked point went.
struct Track {
  Flow flow;
  bool found;  ///< false: the point was lost
};

/// Pyramidal Lucas-Kanade from the last picture to the next: 15x15 pixels on 4 levels, at most 10
/// iterations down to 0.03 pixels, as in the paper's code. 8-bit pictures of one size, any size.
class PointTracker {
 public:
  /// Makes the next picture the one tracked to, and what was the next the one tracked from.
  void push(const PlaneView<std::uint8_t>& picture, int threads);

  /// Follows points of the last picture into the next, after two push(). A track for each point,
  /// good until the next call, the same for any number of threads.
  std::span<const Track> track(std::span<const Point> points, int threads);

 private:
  std::vector<cv::Mat> last_;
  std::vector<cv::Mat> next_;
  std::vector<cv::Point2f> from_;
  std::vector<cv::Point2f> to_;
  std::vector<unsigned char> status_;
  std::vector<float> error_;
  std::vector<Track> tracks_;
};

}  // namespace eventcamera
