// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <opencv2/core/utility.hpp>
#include <thread>
#include <vector>

#include "src/flow/opencv.hpp"

namespace {

using eventcamera::OpenCvThreads;

TEST(OpenCvThreads, PutsBackWhatTheApplicationHadSet) {
  const int before = cv::getNumThreads();
  {
    const OpenCvThreads one(1);
    EXPECT_EQ(cv::getNumThreads(), 1);
    const OpenCvThreads one_more(1);
    EXPECT_EQ(cv::getNumThreads(), 1);
  }
  EXPECT_EQ(cv::getNumThreads(), before);
}

TEST(OpenCvThreads, LetsOnlyEqualsInTogether) {
  const int processors = cv::getNumberOfCPUs();
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, wanted = 1 + i % processors] {
      for (int k = 0; k < 50; ++k) {
        const OpenCvThreads limit(wanted);
        wrong += cv::getNumThreads() != wanted;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(OpenCvThreads, LetsNobodyWaitForEver) {
  if (cv::getNumberOfCPUs() < 2) GTEST_SKIP() << "one processor has one count only";
  std::atomic<bool> done = false;
  std::atomic<int> turns = 0;  // of the others, while the last one waits
  std::vector<std::thread> others;
  for (int i = 0; i < 4; ++i) {
    others.emplace_back([&] {
      while (!done) {
        const OpenCvThreads one(1);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ++turns;
      }
    });
  }
  while (turns < 8) std::this_thread::yield();
  for (int times = 0; times < 5; ++times) {
    const int before = turns;
    const OpenCvThreads two(2);
    EXPECT_LE(turns - before, 40);
  }
  done = true;
  for (auto& other : others) other.join();
}

}  // namespace
