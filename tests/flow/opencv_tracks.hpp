// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <opencv2/video/tracking.hpp>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/flow/opencv.hpp"

/// OpenCV's tracks of these points, on as many levels as ours.
inline std::vector<eventcamera::Track> opencv_tracks(
    const eventcamera::Image<std::uint8_t>& from, const eventcamera::Image<std::uint8_t>& to,
    const std::vector<eventcamera::Point>& points) {
  std::vector<cv::Point2f> starts;
  for (const auto& point : points)
    starts.emplace_back(static_cast<float>(point.x), static_cast<float>(point.y));
  std::vector<cv::Point2f> ends;
  std::vector<unsigned char> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(eventcamera::opencv_image(from.view()),
                           eventcamera::opencv_image(to.view()), starts, ends, status, error,
                           {15, 15}, 3, {3, 10, 0.03});
  std::vector<eventcamera::Track> tracks;
  for (std::size_t i = 0; i < points.size(); ++i)
    tracks.push_back({{ends[i].x - starts[i].x, ends[i].y - starts[i].y}, status[i] != 0});
  return tracks;
}
