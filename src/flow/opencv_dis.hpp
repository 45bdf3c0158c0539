// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// FlowMethod::opencv_dis, in builds with OpenCV.
std::unique_ptr<DenseFlow> make_opencv_dis();

/// Sets the regularisation of the variational refinement as published. Since
/// OpenCV 4.10 it is a parameter of cv::DISOpticalFlow, with another default.
template <class Dis>
void regularise(Dis& dis) {
  constexpr float epsilon = 0.001F;
  if constexpr (requires { dis.setVariationalRefinementEpsilon(epsilon); })
    dis.setVariationalRefinementEpsilon(epsilon);
}

}  // namespace eventcamera
