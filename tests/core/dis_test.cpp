// SPDX-License-Identifier: LGPL-2.1-or-later
// DIS equals its plain reference and OpenCV's: odd sizes, strides, textures and noise. It is
// bit-identical on every SIMD target of this processor, for any number of threads, and independent
// of earlier calls.
#include "src/flow/dis/dis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <thread>

#include "tests/core/opencv_dis.hpp"
#include "tests/core/scene.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/dis.hpp"

namespace {

using namespace eventcamera;

struct Case {
  DisFlow::Quality quality;
  int width;
  int height;
  bool noise;  ///< two unrelated images; else a moving texture
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << (c.quality.patch == 4 ? "low " : "high ") << c.width << "x" << c.height
       << (c.noise ? " noise" : " texture");
}

using Picture = Image<std::uint8_t>;

Picture picture_of(const Case& c, int i) {
  if (c.noise) return scene::noise<std::uint8_t>(c.width, c.height, 8, 1 + i);
  return scene::texture<std::uint8_t>(c.width, c.height, 8, 2.3 * i, -1.4 * i);
}

Image<Flow> copy(const ImageView<Flow>& flow) {
  Image<Flow> result(flow.width, flow.height);
  result.assign(flow);
  return result;
}

Image<Flow> flow_of(const Case& c, const Picture& from, const Picture& to, ThreadPool& threads) {
  DisFlow flow(c.quality);
  return copy(flow.find(from.view(), to.view(), threads));
}

bool equal(const Image<Flow>& a, const Image<Flow>& b) {
  if (a.width() != b.width() || a.height() != b.height()) return false;
  const auto row_size = static_cast<std::size_t>(a.width()) * sizeof(Flow);
  for (int y = 0; y < a.height(); ++y)
    if (std::memcmp(a.row(y), b.row(y), row_size) != 0) return false;
  return true;
}

class Dis : public testing::TestWithParam<Case> {
 protected:
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(
    , Dis,
    testing::Values(Case{DisFlow::low, 64, 64, true}, Case{DisFlow::low, 67, 83, false},
                    Case{DisFlow::low, 150, 111, false}, Case{DisFlow::low, 161, 130, true},
                    Case{DisFlow::low, 64, 600, false}, Case{DisFlow::low, 64, 600, true},
                    Case{DisFlow::high, 64, 64, true}, Case{DisFlow::high, 67, 83, false},
                    Case{DisFlow::high, 150, 111, false}, Case{DisFlow::high, 161, 130, true},
                    Case{DisFlow::high, 64, 600, false}, Case{DisFlow::high, 64, 600, true}));

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
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
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
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
  const Distance distance(flow_of(GetParam(), from, to, threads),
                          opencv_dis(from, to, GetParam().quality));
  EXPECT_LT(distance.mean, 0.02);
}

TEST_P(Dis, IsNothingBetweenEqualPictures) {
  const auto picture = picture_of(GetParam(), 0);
  const auto flow = flow_of(GetParam(), picture, picture, threads);
  for (int y = 0; y < flow.height(); ++y)
    for (int x = 0; x < flow.width(); ++x)
      ASSERT_TRUE(flow.at(x, y).x == 0 && flow.at(x, y).y == 0) << x << ", " << y;
}

TEST_P(Dis, DoesNotDependOnThreads) {
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
  const auto one = flow_of(GetParam(), from, to, threads);
  for (unsigned count = 2; count <= std::thread::hardware_concurrency(); ++count) {
    threads.set_threads(static_cast<int>(count));
    EXPECT_TRUE(equal(flow_of(GetParam(), from, to, threads), one)) << count << " threads";
  }
}

TEST_P(Dis, DoesNotDependOnWhatCameBefore) {
  const auto first = picture_of(GetParam(), 0);
  const auto second = picture_of(GetParam(), 1);
  const auto third = picture_of(GetParam(), 2);
  DisFlow flow(GetParam().quality);
  const auto small = scene::noise<std::uint8_t>(40, 30, 8, 5);
  flow.find(small.view(), small.view(), threads);
  EXPECT_TRUE(equal(copy(flow.find(first.view(), second.view(), threads)),
                    flow_of(GetParam(), first, second, threads)));
  flow.push(third.view(), threads);
  EXPECT_TRUE(equal(copy(flow.flow(threads)), flow_of(GetParam(), second, third, threads)));
}

/// Nothing outside the view is read, neither beside it nor past its end.
TEST_P(Dis, TakesAPartOfAPictureWhereItLies) {
  const int width = GetParam().width;
  const int height = GetParam().height;
  const int stride = width + 13;
  const auto part_of = [&](const Picture& picture, std::uint8_t elsewhere) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(stride * (height - 1) + width),
                                    elsewhere);
    for (int y = 0; y < height; ++y)
      std::memcpy(bytes.data() + std::ptrdiff_t{y} * stride, picture.row(y), picture.width());
    return bytes;
  };
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
  const auto from_bytes = part_of(from, 255);
  const auto to_bytes = part_of(to, 0);
  DisFlow flow(GetParam().quality);
  const auto found = flow.find({from_bytes.data(), stride, width, height},
                               {to_bytes.data(), stride, width, height}, threads);
  EXPECT_TRUE(equal(copy(found), flow_of(GetParam(), from, to, threads)));
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
    const Case c{quality, 40, 70, false};
    const auto from = picture_of(c, 0);
    const auto to = picture_of(c, 1);
    const auto small = flow_of(c, from, to, threads);
    const auto large = flow_of(c, padded(from), padded(to), threads);
    for (int y = 0; y < 70; ++y)
      ASSERT_EQ(std::memcmp(small.row(y), large.row(y), 40 * sizeof(Flow)), 0)
          << testing::PrintToString(c) << ", row " << y;
  }
}

}  // namespace
