// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/dense_flow.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/video/tracking.hpp>

#include "src/flow/opencv_picture.hpp"
#include "src/flow/opencv_threads.hpp"

namespace eventcamera {
namespace {

/// OpenCV's flows need a few patches on each side; smaller pictures are continued beyond their
/// border to this many pixels. They need rows without gaps, too.
constexpr int smallest_side = 64;

class OpenCvFlow : public DenseFlow {
 public:
  PlaneView<Flow> find(const PlaneView<std::uint8_t>& from, const PlaneView<std::uint8_t>& to,
                       int threads) final {
    const OpenCvThreads limit(threads);
    calculate(prepared(from, from_), prepared(to, to_));
    static_assert(sizeof(Flow) == 2 * sizeof(float));
    return {flow_.ptr<Flow>(), static_cast<std::ptrdiff_t>(flow_.step[0]), from.width, from.height};
  }

 protected:
  virtual void calculate(const cv::Mat& from, const cv::Mat& to) = 0;
  cv::Mat flow_;

 private:
  static cv::Mat prepared(const PlaneView<std::uint8_t>& picture, cv::Mat& buffer) {
    cv::Mat mat = opencv_picture(picture);
    if (mat.cols >= smallest_side && mat.rows >= smallest_side && mat.isContinuous()) return mat;
    cv::copyMakeBorder(mat, buffer, 0, std::max(0, smallest_side - mat.rows), 0,
                       std::max(0, smallest_side - mat.cols), cv::BORDER_REPLICATE);
    return buffer;
  }

  cv::Mat from_;
  cv::Mat to_;
};

/// Dense inverse search (Kroeger et al., ECCV 2016). Spatial propagation is OpenCV's addition and
/// stays off: the paper's code has none.
class DisFlow final : public OpenCvFlow {
 public:
  struct Quality {
    int patch;
    int stride;  ///< patch * (1 - overlap)
    int iterations;
    int finest_scale;  ///< flow is found down to 1 / 2^finest_scale of the size
  };

  explicit DisFlow(const Quality& quality) {
    dis_->setPatchSize(quality.patch);
    dis_->setPatchStride(quality.stride);
    dis_->setGradientDescentIterations(quality.iterations);
    dis_->setFinestScale(quality.finest_scale);
    dis_->setUseSpatialPropagation(false);
  }

 private:
  void calculate(const cv::Mat& from, const cv::Mat& to) override {
    flow_.release();  // else the last flow would be where the search begins
    dis_->calc(from, to, flow_);
  }

  cv::Ptr<cv::DISOpticalFlow> dis_ = cv::DISOpticalFlow::create();
};

/// The scale at which OpenCV's DIS starts.
int coarsest_scale(int width, int height, int patch) {
  const auto [shorter, longer] = std::minmax({width, height});
  return std::min(static_cast<int>(std::lround(std::log2(longer / (4.0 * patch)))),
                  static_cast<int>(std::log2(shorter / patch)));
}

DisFlow::Quality low_quality(int width, int height) {
  constexpr int patch = 4;
  constexpr int scales = 3;
  const int coarsest =
      coarsest_scale(std::max(width, smallest_side), std::max(height, smallest_side), patch);
  return {patch, 3, 8, std::max(0, coarsest - scales + 1)};
}

constexpr DisFlow::Quality high_quality = {8, 4, 32, 1};

/// Farneback (SCIA 2003), with the parameters of the paper's code.
class FarnebackFlow final : public OpenCvFlow {
  void calculate(const cv::Mat& from, const cv::Mat& to) override {
    cv::calcOpticalFlowFarneback(from, to, flow_, 0.5, 3, 15, 3, 5, 1.2, 0);
  }
};

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
