// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>
#include <vector>

#include "src/core/luma.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/opencv.hpp"
#include "src/simulate/motion.hpp"

/// OpenCV's optical flow with the parameters of the simulators.
namespace naive {

using namespace eventcamera;

inline void set_opencv_threads(int threads) {
  if (cv::getNumThreads() != threads) cv::setNumThreads(threads);
}

/// Dense flow between frames of at least 64x64 pixels.
class OpenCvFlow {
 public:
  OpenCvFlow(FlowMethod method, int width, int height) : method_(method) {
    if (method == FlowMethod::farneback) return;
    const bool high = method == FlowMethod::dis_hq;
    const int patch = high ? 8 : 4;
    dis_->setPatchSize(patch);
    dis_->setPatchStride(high ? 4 : 3);
    dis_->setGradientDescentIterations(high ? 32 : 8);
    const int third = std::max(0, coarsest_scale(width, height, patch) - 2);
    dis_->setFinestScale(high ? 1 : method == FlowMethod::dis_mq ? std::min(third, 3) : third);
    dis_->setUseSpatialPropagation(false);
  }

  /// Valid until the next call.
  ImageView<Flow> find(const ImageView<std::uint8_t>& from, const ImageView<std::uint8_t>& to,
                       int threads) {
    set_opencv_threads(threads);
    if (method_ == FlowMethod::farneback) {
      cv::calcOpticalFlowFarneback(opencv_image(from), opencv_image(to), flow_, 0.5, 3, 15, 3, 5,
                                   1.2, 0);
    } else {
      flow_.release();  // otherwise the search would start from the last flow
      // OpenCV's DIS requires contiguous rows.
      opencv_image(from).copyTo(from_);
      opencv_image(to).copyTo(to_);
      dis_->calc(from_, to_, flow_);
    }
    return {flow_.ptr<Flow>(), static_cast<std::ptrdiff_t>(flow_.step[0]), from.width, from.height};
  }

 private:
  /// The scale at which OpenCV's DIS starts.
  static int coarsest_scale(int width, int height, int patch) {
    const auto [shorter, longer] = std::minmax({width, height});
    return std::min(static_cast<int>(std::lround(std::log2(longer / (4.0 * patch)))),
                    static_cast<int>(std::log2(shorter / patch)));
  }

  FlowMethod method_;
  cv::Ptr<cv::DISOpticalFlow> dis_ = cv::DISOpticalFlow::create();
  cv::Mat from_;
  cv::Mat to_;
  cv::Mat flow_;
};

/// Ends of tracks.
struct Tracks {
  std::vector<cv::Point2f> ends;
  std::vector<unsigned char> found;
};

/// Pyramidal Lucas-Kanade from the last frame to the next.
class OpenCvTracker {
 public:
  void push(const ImageView<std::uint8_t>& image, int threads) {
    set_opencv_threads(threads);
    std::swap(last_, next_);
    cv::buildOpticalFlowPyramid(opencv_image(image), next_, window, coarsest_level, true,
                                cv::BORDER_REFLECT_101, cv::BORDER_CONSTANT, false);
  }

  /// Valid until the next call.
  const Tracks& track(const std::vector<cv::Point2f>& points, int threads) {
    set_opencv_threads(threads);
    tracks_.ends.clear();
    tracks_.found.clear();
    if (!points.empty())
      cv::calcOpticalFlowPyrLK(last_, next_, points, tracks_.ends, tracks_.found, cv::noArray(),
                               window, coarsest_level,
                               {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.03});
    return tracks_;
  }

 private:
  static constexpr int coarsest_level = 3;
  const cv::Size window{15, 15};
  std::vector<cv::Mat> last_;
  std::vector<cv::Mat> next_;
  Tracks tracks_;
};

/// A tracked pixel that moves through the steps of an interval.
struct MovingPoint {
  int x;
  int y;
  Motion dx;
  Motion dy;

  int x_at(int j) const { return moved(x, dx, j); }
  int y_at(int j) const { return moved(y, dy, j); }
};

/// Calls visit(MovingPoint) for each point whose track was found and ends in the frame.
template <class Visit>
void for_each_moving(const std::vector<cv::Point2f>& points, const Tracks& tracks, int steps,
                     const LumaFormat& format, const Visit& visit) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const cv::Point2f flow = tracks.ends[i] - points[i];
    if (tracks.found[i] == 0 || !std::isfinite(flow.x) || !std::isfinite(flow.y)) continue;
    const MovingPoint point{static_cast<int>(points[i].x), static_cast<int>(points[i].y),
                            motion_per_step(flow.x, steps), motion_per_step(flow.y, steps)};
    const int x = point.x_at(steps);
    const int y = point.y_at(steps);
    if (x >= 0 && x < format.width && y >= 0 && y < format.height) visit(point);
  }
}

}  // namespace naive
