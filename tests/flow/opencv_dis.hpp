// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <opencv2/video/tracking.hpp>

#include "src/flow/dis/dis.hpp"
#include "src/flow/opencv.hpp"

/// OpenCV's implementation of DIS with the parameters of ours, for images of at least 64x64 pixels.
inline eventcamera::Image<eventcamera::Flow> opencv_dis(
    const eventcamera::Image<std::uint8_t>& from, const eventcamera::Image<std::uint8_t>& to,
    const eventcamera::DisFlow::Quality& quality) {
  const auto dis = cv::DISOpticalFlow::create();
  dis->setPatchSize(quality.patch);
  dis->setPatchStride(quality.stride);
  dis->setGradientDescentIterations(quality.iterations);
  dis->setFinestScale(quality.finest_scale(from.width(), from.height()));
  dis->setUseSpatialPropagation(false);
  eventcamera::regularise(*dis);
  cv::Mat flow;
  // Contiguous rows, as it requires.
  dis->calc(opencv_image(from.view()).clone(), opencv_image(to.view()).clone(), flow);
  eventcamera::Image<eventcamera::Flow> result(from.width(), from.height());
  result.assign({flow.ptr<eventcamera::Flow>(), static_cast<std::ptrdiff_t>(flow.step[0]),
                 from.width(), from.height()});
  return result;
}
