// SPDX-License-Identifier: LGPL-2.1-or-later
// DIS of either quality is what OpenCV finds with the same parameters.
#include "src/flow/dis/dis.hpp"

#include <gtest/gtest.h>

#include <tuple>

#include "tests/flow/moving_pictures.hpp"
#include "tests/flow/opencv_dis.hpp"

namespace {

using namespace eventcamera;

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
