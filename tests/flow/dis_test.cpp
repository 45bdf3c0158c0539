// SPDX-License-Identifier: LGPL-2.1-or-later
// DIS equals its plain reference and OpenCV's: odd sizes, textures and noise. It is bit-identical
// on every SIMD target of this processor.
#include "src/flow/dis/dis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/core/targets.hpp"
#include "tests/flow/moving_pictures.hpp"
#include "tests/flow/opencv_dis.hpp"
#include "tests/reference/dis.hpp"

namespace {

using namespace eventcamera;

struct Case {
  DisFlow::Quality quality;
  Pictures pictures;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << (c.quality.patch == 4 ? "low " : "high ") << testing::PrintToString(c.pictures);
}

Image<Flow> flow_of(const Case& c, const Picture& from, const Picture& to, ThreadPool& threads) {
  DisFlow flow(c.quality);
  return copy(flow.find(from.view(), to.view(), threads));
}

class Dis : public testing::TestWithParam<Case> {
 protected:
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(
    , Dis,
    testing::Values(Case{DisFlow::low, {64, 64, true}}, Case{DisFlow::low, {67, 83, false}},
                    Case{DisFlow::low, {150, 111, false}}, Case{DisFlow::low, {161, 130, true}},
                    Case{DisFlow::low, {64, 600, false}}, Case{DisFlow::low, {64, 600, true}},
                    Case{DisFlow::high, {64, 64, true}}, Case{DisFlow::high, {67, 83, false}},
                    Case{DisFlow::high, {150, 111, false}}, Case{DisFlow::high, {161, 130, true}},
                    Case{DisFlow::high, {64, 600, false}}, Case{DisFlow::high, {64, 600, true}}));

struct Distance {
  double mean = 0;
  double max = 0;

  Distance(const Image<Flow>& a, const Image<Flow>& b) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) {
        const double error = std::hypot(a.at(x, y).x - b.at(x, y).x, a.at(x, y).y - b.at(x, y).y);
        mean += error / (a.width() * a.height());
        max = std::max(max, error);
      }
    }
  }
};

TEST_P(Dis, EqualsTheReferenceOnEveryTarget) {
  const auto from = GetParam().pictures.at(0);
  const auto to = GetParam().pictures.at(1);
  const auto best = flow_of(GetParam(), from, to, threads);
  // A search may stop a step earlier or later where its error hardly changes.
  const Distance distance(best, reference::dis(from, to, GetParam().quality));
  EXPECT_LT(distance.mean, 1e-3);
  EXPECT_LT(distance.max, 0.05);
  targets::for_each([&](const char* target) {
    EXPECT_TRUE(equal(flow_of(GetParam(), from, to, threads), best)) << "on " << target;
  });
}

TEST_P(Dis, IsWhatOpenCvFinds) {
  const auto from = GetParam().pictures.at(0);
  const auto to = GetParam().pictures.at(1);
  const Distance distance(flow_of(GetParam(), from, to, threads),
                          opencv_dis(from, to, GetParam().quality));
  EXPECT_LT(distance.mean, 0.02);
}

TEST(SmallPictures, ArePadded) {
  ThreadPool threads;
  const auto padded = [](const Picture& picture) {
    Picture result(64, 70);
    for (int y = 0; y < 70; ++y)
      for (int x = 0; x < 64; ++x) result.at(x, y) = picture.at(std::min(x, 39), y);
    return result;
  };
  for (const auto& quality : {DisFlow::low, DisFlow::high}) {
    const Case c{quality, {40, 70, false}};
    const auto from = c.pictures.at(0);
    const auto to = c.pictures.at(1);
    const auto small = flow_of(c, from, to, threads);
    const auto large = flow_of(c, padded(from), padded(to), threads);
    for (int y = 0; y < 70; ++y)
      ASSERT_EQ(std::memcmp(small.row(y), large.row(y), 40 * sizeof(Flow)), 0)
          << testing::PrintToString(c) << ", row " << y;
  }
}

}  // namespace
