// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/thread_pool.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace {

using eventcamera::ThreadPool;

TEST(ThreadPool, RunsEachRoundOnce) {
  ThreadPool pool;
  for (const int threads : {1, 2, 0, 1}) {
    pool.set_threads(threads);
    for (const int count : {0, 1, 2, 1000}) {
      std::vector<int> rounds(static_cast<std::size_t>(count));
      pool.for_each(count, [&](int i, int thread) {
        ASSERT_GE(thread, 0);
        ASSERT_LT(thread, pool.threads());
        ++rounds[static_cast<std::size_t>(i)];
      });
      for (const int times : rounds) ASSERT_EQ(times, 1);
    }
  }
}

TEST(ThreadPool, ThrowsWhatABodyThrows) {
  ThreadPool pool;
  pool.set_threads(0);
  for (int times = 0; times < 20; ++times) {
    EXPECT_THROW(pool.for_each(100,
                               [](int i, int) {
                                 if (i == 37) throw std::runtime_error("round 37");
                               }),
                 std::runtime_error);
    int rounds = 0;
    pool.for_each(1, [&](int, int) { ++rounds; });
    EXPECT_EQ(rounds, 1);
  }
}

TEST(ThreadPool, RunsShortLoopsOneAfterAnother) {
  ThreadPool pool;
  pool.set_threads(0);
  for (int loop = 0; loop < 20'000; ++loop) {
    int rounds[4] = {};
    pool.for_each(4, [&](int i, int) { rounds[i] += loop; });
    for (const int value : rounds) ASSERT_EQ(value, loop);
  }
}

TEST(ThreadPool, HasNoMoreThreadsThanProcessors) {
  ThreadPool pool;
  pool.set_threads(1'000'000);
  EXPECT_LE(pool.threads(), static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace
