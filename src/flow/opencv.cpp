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
int objects = 0;              // OpenCvThreads that exist
int current_threads = 0;      // their thread count
int application_threads = 0;  // the thread count before the first of them

}  // namespace

OpenCvThreads::OpenCvThreads(int threads) {
  std::unique_lock lock(mutex);
  const unsigned ticket = next_ticket++;
  changed.wait(lock,
               [&] { return ticket == serving && (objects == 0 || current_threads == threads); });
  ++serving;
  changed.notify_all();
  if (objects++ > 0) return;
  current_threads = threads;
  application_threads = cv::getNumThreads();
  if (application_threads != threads) cv::setNumThreads(threads);
}

OpenCvThreads::~OpenCvThreads() {
  const std::lock_guard lock(mutex);
  if (--objects > 0) return;
  if (application_threads != current_threads) cv::setNumThreads(application_threads);
  changed.notify_all();
}

}  // namespace eventcamera
