// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/region_of_interest_flow.hpp"

#include <gtest/gtest.h>

#include "src/simulate/difference.hpp"
#include "tests/flow/moving_pictures.hpp"

namespace {

using namespace eventcamera;

class RegionOfInterest : public testing::TestWithParam<FlowMethod> {
 protected:
  ThreadPool threads;
};
INSTANTIATE_TEST_SUITE_P(, RegionOfInterest,
                         testing::Values(FlowMethod::dis_lq, FlowMethod::dis_mq, FlowMethod::dis_hq,
                                         FlowMethod::farneback, FlowMethod::opencv_dis));

/// A textured square that moves by (3, 1) over a static textured background.
struct MovingPatch {
  MovingPatch() : from(picture(0, 0)), to(picture(3, 1)) {}
  static Image<std::uint8_t> picture(int dx, int dy) {
    auto result = scene::texture<std::uint8_t>(640, 480, 8, 0, 0);
    const auto patch = scene::texture<std::uint8_t>(60, 60, 8, 900, 900);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 60; ++x) result.at(200 + dx + x, 150 + dy + y) = patch.at(x, y);
    return result;
  }
  const Image<std::uint8_t> from;
  const Image<std::uint8_t> to;
};

TEST_P(RegionOfInterest, HasNoFlowWhereNothingChanged) {
  const MovingPatch patch;
  RegionOfInterestFlow finder(GetParam(), 640, 480);
  const auto check = [&](const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, int sign) {
    const auto flow =
        finder.find(from.view(), to.view(), changed_box(from.view(), to.view(), 2), threads);
    double x = 0;
    double y = 0;
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        const auto here = flow.row(v)[u];
        if (u < 100 || v < 50 || u > 363 || v > 311) {
          ASSERT_TRUE(here.x == 0 && here.y == 0);
        }
        if (u >= 215 && u < 245 && v >= 165 && v < 195) {
          x += here.x / 900;
          y += here.y / 900;
        }
      }
    }
    const bool is_coarse = GetParam() == FlowMethod::dis_lq || GetParam() == FlowMethod::dis_mq;
    const double error = is_coarse ? 0.8 : 0.2;
    EXPECT_NEAR(x, 3 * sign, error);
    EXPECT_NEAR(y, 1 * sign, error);
  };
  check(patch.from, patch.to, 1);
  check(patch.to, patch.from, -1);
  const auto still = finder.find(patch.from.view(), patch.from.view(), {}, threads);
  for (int v = 0; v < 480; ++v)
    for (int u = 0; u < 640; ++u) ASSERT_EQ(still.row(v)[u].x, 0);
}

TEST_P(RegionOfInterest, HasTheFlowOfTheWholeWhereAllChanges) {
  const auto a = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto b = scene::texture<std::uint8_t>(320, 240, 8, 2.3, 1.9);
  RegionOfInterestFlow finder(GetParam(), 320, 240);
  const Box all{0, 0, 320, 240};
  const Image<std::uint8_t>* sequence[] = {&a, &b, &b, &a, &b};
  for (int i = 1; i < 5; ++i) {
    const auto& from = *sequence[i - 1];
    const auto& to = *sequence[i];
    const auto flow = finder.find(from.view(), to.view(), i == 2 ? Box{} : all, threads);
    if (i == 2) continue;
    const auto whole = make_dense_flow(GetParam());
    const auto expected = whole->find(from.view(), to.view(), threads);
    ASSERT_TRUE(equal(copy(flow), copy(expected))) << i;
  }
}

}  // namespace
