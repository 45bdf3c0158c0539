// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// FlowMethod::opencv_dis, in builds with OpenCV.
std::unique_ptr<DenseFlow> make_opencv_dis();

}  // namespace eventcamera
