// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/context.hpp"

namespace eventcamera::gl {

/// A point in the GPU's command queue.
class Fence {
 public:
  explicit Fence(const Context& gl) : gl_(gl) {}
  ~Fence() { gl_.DeleteSync(sync_); }
  Fence(const Fence&) = delete;
  Fence& operator=(const Fence&) = delete;

  /// Moves it to the end of the queue.
  void set();

  /// Waits until the GPU has reached it. Throws Error.
  void wait() const;

 private:
  const Context& gl_;
  GLsync sync_ = nullptr;
};

}  // namespace eventcamera::gl
