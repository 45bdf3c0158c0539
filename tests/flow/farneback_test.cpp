// SPDX-License-Identifier: LGPL-2.1-or-later
// Farneback's flow equals its plain reference: sizes down to one pixel and up to four levels,
// textures and noise. It is bit-identical on every SIMD target of this processor.
#include "src/flow/farneback/farneback.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/targets.hpp"
#include "tests/flow/moving_pictures.hpp"
#include "tests/reference/farneback.hpp"

namespace {

using namespace eventcamera;

Image<Flow> flow_of(const Picture& from, const Picture& to, ThreadPool& threads) {
  FarnebackFlow flow;
  return copy(flow.find(from.view(), to.view(), threads));
}

class Farneback : public testing::TestWithParam<Pictures> {
 protected:
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(Small, Farneback,
                         testing::Values(Pictures{1, 1, true}, Pictures{1, 9, true},
                                         Pictures{9, 1, true}, Pictures{2, 3, false},
                                         Pictures{13, 7, true}, Pictures{16, 15, false},
                                         Pictures{17, 33, true}));
INSTANTIATE_TEST_SUITE_P(Pyramids, Farneback,
                         testing::Values(Pictures{64, 64, false}, Pictures{65, 83, true},
                                         Pictures{97, 61, false}, Pictures{131, 130, false},
                                         Pictures{300, 257, false}, Pictures{259, 261, true}));

TEST_P(Farneback, EqualsTheReferenceOnEveryTarget) {
  const auto from = GetParam().at(0);
  const auto to = GetParam().at(1);
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

}  // namespace
