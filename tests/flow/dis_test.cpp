// SPDX-License-Identifier: LGPL-2.1-or-later
// DIS of either quality is what OpenCV finds with the same parameters.
#include "src/flow/dis/dis.hpp"

#include <gtest/gtest.h>

#include <opencv2/video/tracking.hpp>
#include <tuple>

#include "src/flow/opencv.hpp"
#include "tests/flow/moving_pictures.hpp"

namespace {

using namespace eventcamera;

/// OpenCV's implementation of DIS with the parameters of ours, for images of at least 64x64 pixels.
Image<Flow> opencv_dis(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to,
                       const DisFlow::Quality& quality) {
  const auto dis = cv::DISOpticalFlow::create();
  dis->setPatchSize(quality.patch);
  dis->setPatchStride(quality.stride);
  dis->setGradientDescentIterations(quality.iterations);
  dis->setFinestScale(quality.finest_scale(from.width(), from.height()));
  dis->setUseSpatialPropagation(false);
  regularise(*dis);
  cv::Mat flow;
  // Contiguous rows, as it requires.
  dis->calc(opencv_image(from.view()).clone(), opencv_image(to.view()).clone(), flow);
  Image<Flow> result(from.width(), from.height());
  result.assign(
      {flow.ptr<Flow>(), static_cast<std::ptrdiff_t>(flow.step[0]), from.width(), from.height()});
  return result;
}

class Dis : public testing::TestWithParam<std::tuple<bool, Pictures>> {};

INSTANTIATE_TEST_SUITE_P(
    , Dis,
    testing::Combine(testing::Bool(),
                     testing::Values(Pictures{64, 64, true}, Pictures{67, 83, false},
                                     Pictures{150, 111, false}, Pictures{161, 130, true},
                                     Pictures{64, 600, false}, Pictures{64, 600, true})));

TEST_P(Dis, IsWhatOpenCvFinds) {
  const auto [is_high, pictures] = GetParam();
  const auto& quality = is_high ? DisFlow::high : DisFlow::low;
  const auto from = pictures.at(0);
  const auto to = pictures.at(1);
  DisFlow ours(quality);
  ThreadPool threads;
  const auto error =
      difference(copy(ours.find(from.view(), to.view(), threads)), opencv_dis(from, to, quality));
  EXPECT_LT(error.mean, 0.02);
}

}  // namespace
