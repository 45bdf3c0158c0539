// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <opencv2/video/tracking.hpp>

#include "src/flow/dense_flow.hpp"
#include "src/flow/opencv.hpp"

/// OpenCV's implementation of Farneback's method, with the parameters of the paper's code.
inline eventcamera::Image<eventcamera::Flow> opencv_farneback(
    const eventcamera::Image<std::uint8_t>& from, const eventcamera::Image<std::uint8_t>& to) {
  eventcamera::Image<eventcamera::Flow> flow(from.width(), from.height());
  cv::Mat mat(from.height(), from.width(), CV_32FC2, flow.row(0),
              static_cast<std::size_t>(flow.stride()));
  cv::calcOpticalFlowFarneback(eventcamera::opencv_image(from.view()),
                               eventcamera::opencv_image(to.view()), mat, 0.5, 3, 15, 3, 5, 1.2, 0);
  return flow;
}
