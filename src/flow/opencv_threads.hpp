// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace eventcamera {

/// Lets OpenCV use this many threads while it lives.
///
/// OpenCV has one thread count for the whole process. Calls that want the same count run side by
/// side; one that wants another waits until they are done, and those that come after it wait behind
/// it. The last to leave puts back the count that the application had set.
class OpenCvThreads {
 public:
  explicit OpenCvThreads(int threads);
  ~OpenCvThreads();
  OpenCvThreads(const OpenCvThreads&) = delete;
  OpenCvThreads& operator=(const OpenCvThreads&) = delete;
};

}  // namespace eventcamera
