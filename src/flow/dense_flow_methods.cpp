// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dense_flow.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/video/tracking.hpp>

#include "src/flow/farneback/farneback.hpp"
#include "src/flow/opencv.hpp"

namespace eventcamera {
namespace {

/// Minimum width and height for OpenCV's DIS, which needs several patches along each side. Smaller
/// images are padded by replicating their border.
constexpr int min_side = 64;

/// Dense inverse search (Kroeger et al., ECCV 2016), without the spatial propagation that OpenCV
/// adds.
class DisFlow final : public DenseFlow {
 public:
  struct Quality {
    int patch;
    int stride;  ///< patch * (1 - overlap)
    int iterations;
    int finest_scale;  ///< the finest level has 1 / 2^finest_scale of the size
  };

  explicit DisFlow(const Quality& quality) {
    dis_->setPatchSize(quality.patch);
    dis_->setPatchStride(quality.stride);
    dis_->setGradientDescentIterations(quality.iterations);
    dis_->setFinestScale(quality.finest_scale);
    dis_->setUseSpatialPropagation(false);
  }

  void push(const ImageView<std::uint8_t>& picture, ThreadPool& /*threads*/) override {
    cv::swap(last_, next_);
    cv::copyMakeBorder(opencv_picture(picture), next_, 0, std::max(0, min_side - picture.height), 0,
                       std::max(0, min_side - picture.width), cv::BORDER_REPLICATE);
    width_ = picture.width;
    height_ = picture.height;
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

/// Scale at which OpenCV's DIS starts.
int coarsest_scale(int width, int height, int patch) {
  const auto [shorter, longer] = std::minmax({width, height});
  return std::min(static_cast<int>(std::lround(std::log2(longer / (4.0 * patch)))),
                  static_cast<int>(std::log2(shorter / patch)));
}

DisFlow::Quality low_quality(int width, int height) {
  constexpr int patch = 4;
  constexpr int scales = 3;
  const int coarsest = coarsest_scale(std::max(width, min_side), std::max(height, min_side), patch);
  return {patch, 3, 8, std::max(0, coarsest - scales + 1)};
}

constexpr DisFlow::Quality high_quality = {8, 4, 32, 1};

}  // namespace

std::unique_ptr<DenseFlow> make_dense_flow(FlowMethod method, int width, int height) {
  switch (method) {
    case FlowMethod::dis_lq:
      return std::make_unique<DisFlow>(low_quality(width, height));
    case FlowMethod::dis_hq:
      return std::make_unique<DisFlow>(high_quality);
    case FlowMethod::farneback:
      return std::make_unique<FarnebackFlow>();
  }
  return nullptr;
}

}  // namespace eventcamera
