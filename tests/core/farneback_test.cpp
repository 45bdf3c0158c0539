// SPDX-License-Identifier: LGPL-2.1-or-later
// Farneback's flow equals its plain reference: sizes down to one pixel and up to four levels,
// strides, textures and noise. It is bit-identical on every SIMD target of this processor, for any
// number of threads, and independent of earlier calls.
#include "src/flow/farneback/farneback.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>

#include "tests/core/scene.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/farneback.hpp"

namespace {

using namespace eventcamera;

struct Case {
  int width;
  int height;
  bool noise;  ///< two unrelated images; else a moving texture
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.width << "x" << c.height << (c.noise ? " noise" : " texture");
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

Image<Flow> flow_of(const Picture& from, const Picture& to, ThreadPool& threads) {
  FarnebackFlow flow;
  return copy(flow.find(from.view(), to.view(), threads));
}

bool equal(const Image<Flow>& a, const Image<Flow>& b) {
  if (a.width() != b.width() || a.height() != b.height()) return false;
  const auto row_size = static_cast<std::size_t>(a.width()) * sizeof(Flow);
  for (int y = 0; y < a.height(); ++y)
    if (std::memcmp(a.row(y), b.row(y), row_size) != 0) return false;
  return true;
}

class Farneback : public testing::TestWithParam<Case> {
 protected:
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(Small, Farneback,
                         testing::Values(Case{1, 1, true}, Case{1, 9, true}, Case{9, 1, true},
                                         Case{2, 3, false}, Case{13, 7, true}, Case{16, 15, false},
                                         Case{17, 33, true}));
INSTANTIATE_TEST_SUITE_P(Pyramids, Farneback,
                         testing::Values(Case{64, 64, false}, Case{65, 83, true},
                                         Case{97, 61, false}, Case{131, 130, false},
                                         Case{300, 257, false}, Case{259, 261, true}));

TEST_P(Farneback, EqualsTheReferenceOnEveryTarget) {
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
  const auto expected = reference::farneback(from, to);
  const auto best = flow_of(from, to, threads);
  double error = 0;
  for (int y = 0; y < from.height(); ++y)
    for (int x = 0; x < from.width(); ++x)
      error = std::max<double>(error, std::hypot(best.at(x, y).x - expected.at(x, y).x,
                                                 best.at(x, y).y - expected.at(x, y).y));
  EXPECT_LT(error, 1e-4);
  targets::for_each([&](const char* target) {
    EXPECT_TRUE(equal(flow_of(from, to, threads), best)) << "on " << target;
  });
}

TEST_P(Farneback, IsNothingBetweenEqualPictures) {
  const auto picture = picture_of(GetParam(), 0);
  const auto flow = flow_of(picture, picture, threads);
  for (int y = 0; y < flow.height(); ++y)
    for (int x = 0; x < flow.width(); ++x)
      ASSERT_TRUE(flow.at(x, y).x == 0 && flow.at(x, y).y == 0) << x << ", " << y;
}

TEST_P(Farneback, DoesNotDependOnThreads) {
  const auto from = picture_of(GetParam(), 0);
  const auto to = picture_of(GetParam(), 1);
  const auto one = flow_of(from, to, threads);
  for (unsigned count = 2; count <= std::thread::hardware_concurrency(); ++count) {
    threads.set_threads(static_cast<int>(count));
    EXPECT_TRUE(equal(flow_of(from, to, threads), one)) << count << " threads";
  }
}

TEST_P(Farneback, DoesNotDependOnWhatCameBefore) {
  const auto first = picture_of(GetParam(), 0);
  const auto second = picture_of(GetParam(), 1);
  const auto third = picture_of(GetParam(), 2);
  FarnebackFlow flow;
  const auto small = scene::noise<std::uint8_t>(40, 30, 8, 5);
  flow.find(small.view(), small.view(), threads);
  EXPECT_TRUE(equal(copy(flow.find(first.view(), second.view(), threads)),
                    flow_of(first, second, threads)));
  flow.push(third.view(), threads);
  EXPECT_TRUE(equal(copy(flow.flow(threads)), flow_of(second, third, threads)));
}

/// Nothing outside the view is read, neither beside it nor past its end.
TEST_P(Farneback, TakesAPartOfAPictureWhereItLies) {
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
  FarnebackFlow flow;
  const auto found = flow.find({from_bytes.data(), stride, width, height},
                               {to_bytes.data(), stride, width, height}, threads);
  EXPECT_TRUE(equal(copy(found), flow_of(from, to, threads)));
}

}  // namespace
