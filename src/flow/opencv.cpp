// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/flow/opencv.hpp"

#include <condition_variable>
#include <mutex>
#include <opencv2/core/utility.hpp>

namespace eventcamera {
namespace {

std::mutex mutex;  // guards the variables below and OpenCV's thread count
std::condition_variable changed;
unsigned next_ticket = 0;  // first come, first served, so that no thread starves
unsigned serving = 0;
int calls = 0;
int in_force = 0;
int before = 0;

}  // namespace

OpenCvThreads::OpenCvThreads(int threads) {
  std::unique_lock lock(mutex);
  const unsigned ticket = next_ticket++;
  changed.wait(lock, [&] { return ticket == serving && (calls == 0 || in_force == threads); });
  ++serving;
  changed.notify_all();
  if (calls++ > 0) return;
  in_force = threads;
  before = cv::getNumThreads();
  if (before != threads) cv::setNumThreads(threads);
}

OpenCvThreads::~OpenCvThreads() {
  const std::lock_guard lock(mutex);
  if (--calls > 0) return;
  if (before != in_force) cv::setNumThreads(before);
  changed.notify_all();
}

}  // namespace eventcamera
