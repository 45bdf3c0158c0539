// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/opencv_dis.hpp"

#include <algorithm>
#include <opencv2/video/tracking.hpp>

#include "src/flow/dis/dis.hpp"
#include "src/flow/opencv.hpp"

namespace eventcamera {
namespace {

/// OpenCV's DIS, without the spatial propagation that it adds to the published method.
class OpenCvDisFlow final : public DenseFlow {
 public:
  OpenCvDisFlow() {
    dis_->setPatchSize(DisFlow::high.patch);
    dis_->setPatchStride(DisFlow::high.stride);
    dis_->setGradientDescentIterations(DisFlow::high.iterations);
    dis_->setFinestScale(1);
    dis_->setUseSpatialPropagation(false);
    regularise(*dis_);
  }

  void push(const ImageView<std::uint8_t>& image, ThreadPool& /*threads*/) override {
    cv::swap(last_, next_);
    cv::copyMakeBorder(opencv_image(image), next_, 0, std::max(0, DisFlow::min_side - image.height),
                       0, std::max(0, DisFlow::min_side - image.width), cv::BORDER_REPLICATE);
    width_ = image.width;
    height_ = image.height;
  }

  ImageView<Flow> flow(ThreadPool& threads) override {
    const OpenCvThreads limit(threads.threads());
    flow_.release();  // otherwise the search would start from the last flow
    dis_->calc(last_, next_, flow_);
    static_assert(sizeof(Flow) == 2 * sizeof(float));
    return {flow_.ptr<Flow>(), static_cast<std::ptrdiff_t>(flow_.step[0]), width_, height_};
  }

 private:
  cv::Ptr<cv::DISOpticalFlow> dis_ = cv::DISOpticalFlow::create();
  cv::Mat last_;
  cv::Mat next_;
  cv::Mat flow_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace

std::unique_ptr<DenseFlow> make_opencv_dis() {
  return std::make_unique<OpenCvDisFlow>();
}

}  // namespace eventcamera
