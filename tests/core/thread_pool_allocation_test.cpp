// SPDX-License-Identifier: LGPL-2.1-or-later
// Loops allocate nothing.
#include <gtest/gtest.h>

#include <cstdlib>
#include <vector>

#include "src/core/thread_pool.hpp"
#include "tests/core/allocations.hpp"

namespace {

TEST(Allocations, AreCounted) {
  const int before = allocations;
  free(malloc(1));
  EXPECT_EQ(allocations - before, 1);
  std::vector<int> vector(100'000);
  EXPECT_EQ(allocations - before, 2);
  vector.push_back(0);
  EXPECT_EQ(allocations - before, 3);
}

TEST(Allocations, AreNotMadeByLoops) {
  eventcamera::ThreadPool pool;
  pool.set_threads(0);
  const auto loop = [&] { pool.for_each(100, [](int, int) {}); };
  loop();
  const int before = allocations;
  for (int i = 0; i < 1000; ++i) loop();
  EXPECT_EQ(allocations - before, 0);
}

}  // namespace
