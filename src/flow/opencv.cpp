// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/opencv.hpp"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <opencv2/video/tracking.hpp>

#include "src/flow/dis/dis.hpp"

namespace eventcamera {
namespace {

std::mutex mutex;  // guards the variables below and OpenCV's thread count
std::condition_variable changed;
unsigned next_ticket = 0;  // first come, first served, so that no thread starves
unsigned serving = 0;
int objects = 0;              // OpenCvThreads that exist
int current_threads = 0;      // their thread count
int application_threads = 0;  // the thread count before the first of them

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

OpenCvThreads::OpenCvThreads(int threads) {
  std::unique_lock lock(mutex);
  const unsigned ticket = next_ticket++;
  changed.wait(lock,
               [&] { return ticket == serving && (objects == 0 || current_threads == threads); });
  ++serving;
  changed.notify_all();
  if (objects++ > 0) return;
  current_threads = threads;
  application_threads = cv::getNumThreads();
  if (application_threads != threads) cv::setNumThreads(threads);
}

OpenCvThreads::~OpenCvThreads() {
  const std::lock_guard lock(mutex);
  if (--objects > 0) return;
  if (application_threads != current_threads) cv::setNumThreads(application_threads);
  changed.notify_all();
}

std::unique_ptr<DenseFlow> make_opencv_dis() {
  return std::make_unique<OpenCvDisFlow>();
}

}  // namespace eventcamera
