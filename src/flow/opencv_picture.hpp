// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <opencv2/core.hpp>

#include "src/core/image.hpp"

namespace eventcamera {

/// A picture as OpenCV sees it, where it lies. OpenCV only reads what it takes as input, though
/// its type cannot say so.
inline cv::Mat opencv_picture(const ImageView<std::uint8_t>& picture) {
  return {picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.data),
          static_cast<std::size_t>(picture.stride)};
}

}  // namespace eventcamera
