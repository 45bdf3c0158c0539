// SPDX-License-Identifier: LGPL-2.1-or-later
// The contract of dense flow, which every method keeps, on odd sizes and strides, textures and
// noise: it is the same on every SIMD target, 0 between equal pictures, and depends neither on the
// number of threads, nor on earlier calls, nor on memory around a picture. How good it is:
// dis_test.cpp and known_flow_test.cpp.
#include "src/flow/dense_flow.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <tuple>
#include <vector>

#include "tests/core/targets.hpp"
#include "tests/flow/moving_pictures.hpp"

namespace {

using namespace eventcamera;

struct Method {
  const char* name;
  FlowMethod method;

  std::unique_ptr<DenseFlow> make() const { return make_dense_flow(method); }
};

constexpr Method methods[] = {{"dis_lq", FlowMethod::dis_lq},
                              {"dis_mq", FlowMethod::dis_mq},
                              {"dis_hq", FlowMethod::dis_hq},
                              {"farneback", FlowMethod::farneback},
                              {"opencv_dis", FlowMethod::opencv_dis}};

class EveryFlow : public testing::TestWithParam<std::tuple<Method, Pictures>> {
 protected:
  Image<Flow> flow_of(const Picture& from, const Picture& to) {
    return copy(method.make()->find(from.view(), to.view(), threads));
  }

  const Method method = std::get<0>(GetParam());
  const Pictures pictures = std::get<1>(GetParam());
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(
    , EveryFlow,
    testing::Combine(testing::ValuesIn(methods),
                     testing::Values(Pictures{1, 1, true}, Pictures{1, 9, true},
                                     Pictures{9, 1, true}, Pictures{2, 3, false},
                                     Pictures{13, 7, true}, Pictures{16, 15, false},
                                     Pictures{17, 33, true}, Pictures{64, 64, true},
                                     Pictures{67, 83, false}, Pictures{150, 111, false},
                                     Pictures{161, 130, true}, Pictures{64, 600, false},
                                     Pictures{64, 600, true}, Pictures{257, 300, false},
                                     Pictures{259, 261, true})),
    [](const auto& test) {
      return std::get<0>(test.param).name + ("_" + testing::PrintToString(std::get<1>(test.param)));
    });

TEST_P(EveryFlow, IsTheSameOnEveryTarget) {
  const auto from = pictures.at(0);
  const auto to = pictures.at(1);
  const auto best = flow_of(from, to);
  targets::for_each(
      [&](const char* target) { EXPECT_TRUE(equal(flow_of(from, to), best)) << "on " << target; });
}

/// It moves by more than its size, and is smaller than a patch at the coarsest scale. Without
/// propagation, the mean error is 35 pixels.
TEST(DisMediumQuality, FollowsASmallFastObject) {
  constexpr int side = 24;
  constexpr Flow motion = {36, 4};
  const auto picture = [](int left, int top) {
    const auto background = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
    const auto object = scene::texture<std::uint8_t>(side, side, 8, 50, 90);
    Picture result(320, 240);
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        const int u = x - left;
        const int v = y - top;
        const bool within = u >= 0 && u < side && v >= 0 && v < side;
        result.at(x, y) =
            within ? object.at(u, v) : static_cast<std::uint8_t>(100 + background.at(x, y) / 16);
      }
    }
    return result;
  };
  const auto from = picture(100, 100);
  const auto to = picture(136, 104);
  ThreadPool threads;
  const auto finder = make_dense_flow(FlowMethod::dis_mq);
  const auto flow = finder->find(from.view(), to.view(), threads);
  for (int y = 104; y < 100 + side - 4; ++y) {
    for (int x = 104; x < 100 + side - 4; ++x) {
      EXPECT_NEAR(flow.row(y)[x].x, motion.x, 0.5);
      EXPECT_NEAR(flow.row(y)[x].y, motion.y, 0.5);
    }
  }
}

TEST_P(EveryFlow, IsZeroBetweenEqualPictures) {
  const auto flow = flow_of(pictures.at(0), pictures.at(0));
  for (int y = 0; y < flow.height(); ++y)
    for (int x = 0; x < flow.width(); ++x)
      ASSERT_TRUE(flow.at(x, y).x == 0 && flow.at(x, y).y == 0) << x << ", " << y;
}

TEST_P(EveryFlow, DoesNotDependOnThreads) {
  const auto one = flow_of(pictures.at(0), pictures.at(1));
  for (const int count : {2, 3, 7, 16}) {  // also more than there are processors
    threads.set_threads(count);
    EXPECT_TRUE(equal(flow_of(pictures.at(0), pictures.at(1)), one)) << count << " threads";
  }
}

TEST_P(EveryFlow, DoesNotDependOnEarlierCalls) {
  const auto flow = method.make();
  const auto small = scene::noise<std::uint8_t>(40, 30, 8, 5);
  flow->find(small.view(), small.view(), threads);
  EXPECT_TRUE(equal(copy(flow->find(pictures.at(0).view(), pictures.at(1).view(), threads)),
                    flow_of(pictures.at(0), pictures.at(1))));
  flow->push(pictures.at(2).view(), threads);
  EXPECT_TRUE(equal(copy(flow->flow(threads)), flow_of(pictures.at(1), pictures.at(2))));
}

/// Nothing outside the view is read, neither beside it nor past its end.
TEST_P(EveryFlow, AcceptsAViewOfALargerPicture) {
  const int width = pictures.width;
  const int height = pictures.height;
  const int stride = width + 13;
  const auto bytes_of = [&](const Picture& picture, std::uint8_t elsewhere) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(stride * (height - 1) + width),
                                    elsewhere);
    for (int y = 0; y < height; ++y)
      std::memcpy(bytes.data() + std::ptrdiff_t{y} * stride, picture.row(y), width);
    return bytes;
  };
  const auto from = bytes_of(pictures.at(0), 255);
  const auto to = bytes_of(pictures.at(1), 0);
  EXPECT_TRUE(equal(copy(method.make()->find({from.data(), stride, width, height},
                                             {to.data(), stride, width, height}, threads)),
                    flow_of(pictures.at(0), pictures.at(1))));
}

class EveryMethod : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(, EveryMethod, testing::ValuesIn(methods),
                         [](const auto& test) { return test.param.name; });

TEST_P(EveryMethod, PointsFromTheEarlierFrameToTheLater) {
  const auto from = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(320, 240, 8, -3, 2);  // moves right and up
  ThreadPool threads;
  const auto finder = GetParam().make();
  const auto flow = finder->find(from.view(), to.view(), threads);
  double x = 0;
  double y = 0;
  for (int v = 40; v < 200; ++v) {
    for (int u = 40; u < 280; ++u) {
      x += flow.row(v)[u].x;
      y += flow.row(v)[u].y;
    }
  }
  const auto method = GetParam().method;
  const bool is_coarse = method == FlowMethod::dis_lq || method == FlowMethod::dis_mq;
  const double error = is_coarse ? 0.8 : 0.2;
  EXPECT_NEAR(x / (160 * 240), 3, error);
  EXPECT_NEAR(y / (160 * 240), -2, error);
}

}  // namespace
