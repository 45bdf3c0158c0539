// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/point_tracker.hpp"

#include <cmath>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "src/flow/opencv_picture.hpp"
#include "src/flow/opencv_threads.hpp"

namespace eventcamera {
namespace {

const cv::Size window(15, 15);
constexpr int coarsest_level = 3;
const cv::TermCriteria enough(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.03);

}  // namespace

void PointTracker::push(const PlaneView<std::uint8_t>& picture, int threads) {
  const OpenCvThreads limit(threads);
  std::swap(last_, next_);
  cv::buildOpticalFlowPyramid(opencv_picture(picture), next_, window, coarsest_level, true,
                              cv::BORDER_REFLECT_101, cv::BORDER_CONSTANT, false);
}

std::span<const Track> PointTracker::track(std::span<const Point> points, int threads) {
  tracks_.clear();
  if (points.empty()) return tracks_;
  from_.clear();
  for (const auto& point : points)
    from_.emplace_back(static_cast<float>(point.x), static_cast<float>(point.y));
  {
    const OpenCvThreads limit(threads);
    cv::calcOpticalFlowPyrLK(last_, next_, from_, to_, status_, error_, window, coarsest_level,
                             enough);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Flow flow{to_[i].x - from_[i].x, to_[i].y - from_[i].y};
    tracks_.push_back({flow, status_[i] != 0 && std::isfinite(flow.x) && std::isfinite(flow.y)});
  }
  return tracks_;
}

}  // namespace eventcamera
