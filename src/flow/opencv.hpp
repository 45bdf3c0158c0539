// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Wraps an image in a cv::Mat without copying. Read-only, which cv::Mat cannot express.
inline cv::Mat opencv_image(const ImageView<std::uint8_t>& image) {
  return {image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
          static_cast<std::size_t>(image.stride)};
}

/// Sets OpenCV's thread count during its lifetime.
///
/// OpenCV has one thread count per process. Objects with the same count coexist; an object with
/// another count waits until they are gone, and later ones queue behind it. The last one restores
/// the application's count.
class OpenCvThreads {
 public:
  explicit OpenCvThreads(int threads);
  ~OpenCvThreads();
  OpenCvThreads(const OpenCvThreads&) = delete;
  OpenCvThreads& operator=(const OpenCvThreads&) = delete;
};

std::unique_ptr<DenseFlow> make_opencv_dis();

/// Sets the regularisation of the variational refinement as published. Since OpenCV 4.10 it is a
/// parameter of cv::DISOpticalFlow, with another default.
template <class Dis>
void regularise(Dis& dis) {
  constexpr float epsilon = 0.001F;
  if constexpr (requires { dis.setVariationalRefinementEpsilon(epsilon); })
    dis.setVariationalRefinementEpsilon(epsilon);
}

}  // namespace eventcamera
