// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <string_view>

#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Pinhole camera with lens distortion, in the model of OpenCV
/// (https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html and group__calib3d__fisheye).
struct CameraCalibration {
  /// Models of the distortion.
  enum class Lens {
    plumb_bob,  ///< k1, k2, p1, p2, k3
    fisheye     ///< k1, k2, k3, k4
  };

  Lens lens = Lens::plumb_bob;
  double fx = 1;  ///< focal lengths, in pixels
  double fy = 1;
  double cx = 0;  ///< principal point, in pixels
  double cy = 0;
  std::array<double, 5> distortion{};
  SensorSize size{};  ///< 0 if the file does not say

  /// A point of the picture, in pixels from the centre of the first one.
  struct Point {
    double x;
    double y;
  };

  /// Maps a point of the undistorted picture to the distorted one.
  Point distorted(Point point) const;

  /// Maps a point of the distorted picture to the undistorted one; NaN if there is no such point.
  Point undistorted(Point point) const;
};

/// Reads a calibration in YAML or XML, as OpenCV's FileStorage writes it, with camera_matrix and
/// distortion_coefficients (or K and D, or cameraMatrix and distCoeffs as GStreamer's
/// cameracalibrate), and optionally image_width and image_height, and fisheye_model; or as ROS's
/// camera_calibration writes it, with distortion_model. Throws std::invalid_argument that says what
/// is wrong.
CameraCalibration parse_calibration(std::string_view text);

}  // namespace eventcamera
