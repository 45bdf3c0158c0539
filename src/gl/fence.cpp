// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/fence.hpp"

namespace eventcamera::gl {

/// Maximum time in which a driver must complete an interval, nanoseconds.
static constexpr GLuint64 patience = 60'000'000'000;

void Fence::set() {
  gl_.DeleteSync(sync_);
  sync_ = gl_.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl_.Flush();
}

void Fence::wait() const {
  const GLenum state = gl_.ClientWaitSync(sync_, 0, patience);
  gl_.check();
  if (state == GL_TIMEOUT_EXPIRED) throw Error("OpenGL has not answered for a minute");
  if (state == GL_WAIT_FAILED) throw Error("OpenGL cannot wait for the GPU");
}

}  // namespace eventcamera::gl
