// SPDX-License-Identifier: LGPL-2.1-or-later
// What our implementations of dense flow have in common, on odd sizes and strides, textures and
// noise: no flow between equal pictures, and independence of the number of threads, of earlier
// calls, and of what lies around a picture.
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <tuple>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "tests/flow/moving_pictures.hpp"

namespace {

using namespace eventcamera;

class OurFlow : public testing::TestWithParam<std::tuple<FlowMethod, Pictures>> {
 protected:
  static std::unique_ptr<DenseFlow> make() { return make_dense_flow(std::get<0>(GetParam())); }
  Image<Flow> flow_of(const Picture& from, const Picture& to) {
    return copy(make()->find(from.view(), to.view(), threads));
  }

  const Pictures pictures = std::get<1>(GetParam());
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(
    , OurFlow,
    testing::Combine(testing::Values(FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback),
                     testing::Values(Pictures{1, 1, true}, Pictures{1, 9, true},
                                     Pictures{13, 7, true}, Pictures{16, 15, false},
                                     Pictures{64, 64, true}, Pictures{67, 83, false},
                                     Pictures{161, 130, true}, Pictures{64, 600, true},
                                     Pictures{300, 257, false})));

TEST_P(OurFlow, IsNothingBetweenEqualPictures) {
  const auto flow = flow_of(pictures.at(0), pictures.at(0));
  for (int y = 0; y < flow.height(); ++y)
    for (int x = 0; x < flow.width(); ++x)
      ASSERT_TRUE(flow.at(x, y).x == 0 && flow.at(x, y).y == 0) << x << ", " << y;
}

TEST_P(OurFlow, DoesNotDependOnThreads) {
  const auto one = flow_of(pictures.at(0), pictures.at(1));
  for (const int count : {2, 3, 7, 16}) {  // also more than there are processors
    threads.set_threads(count);
    EXPECT_TRUE(equal(flow_of(pictures.at(0), pictures.at(1)), one)) << count << " threads";
  }
}

TEST_P(OurFlow, DoesNotDependOnWhatCameBefore) {
  const auto flow = make();
  const auto small = scene::noise<std::uint8_t>(40, 30, 8, 5);
  flow->find(small.view(), small.view(), threads);
  EXPECT_TRUE(equal(copy(flow->find(pictures.at(0).view(), pictures.at(1).view(), threads)),
                    flow_of(pictures.at(0), pictures.at(1))));
  flow->push(pictures.at(2).view(), threads);
  EXPECT_TRUE(equal(copy(flow->flow(threads)), flow_of(pictures.at(1), pictures.at(2))));
}

/// Nothing outside the view is read, neither beside it nor past its end.
TEST_P(OurFlow, TakesAPartOfAPictureWhereItLies) {
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
  const auto flow = make();
  EXPECT_TRUE(equal(copy(flow->find({from.data(), stride, width, height},
                                    {to.data(), stride, width, height}, threads)),
                    flow_of(pictures.at(0), pictures.at(1))));
}

}  // namespace
