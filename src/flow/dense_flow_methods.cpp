// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dense_flow.hpp"

#include "features.hpp"
#include "src/flow/dis/dis.hpp"
#include "src/flow/farneback/farneback.hpp"
#if defined(HAVE_OPENCV) && !defined(OWN_METHODS)
#include "src/flow/opencv.hpp"
#endif

namespace eventcamera {
std::unique_ptr<DenseFlow> make_dense_flow(FlowMethod method) {
  switch (method) {
    case FlowMethod::dis_lq:
      return std::make_unique<DisFlow>(DisFlow::low);
    case FlowMethod::dis_mq:
      return std::make_unique<DisFlow>(DisFlow::medium);
    case FlowMethod::dis_hq:
      return std::make_unique<DisFlow>(DisFlow::high);
    case FlowMethod::farneback:
      return std::make_unique<FarnebackFlow>();
    case FlowMethod::opencv_dis:
#if defined(HAVE_OPENCV) && !defined(OWN_METHODS)
      return make_opencv_dis();
#else
      break;
#endif
  }
  return nullptr;
}

}  // namespace eventcamera
