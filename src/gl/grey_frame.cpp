// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/grey_frame.hpp"

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

LumaKernel::LumaKernel(const Context& gl) : gl_(gl), kernel_(gl, "luma", shaders::luma) {}

void LumaKernel::run(const TextureFrame& frame, const GreyFrame& out) const {
  const auto& [width, height, bits] = frame.format;
  const int words = GreyFrame::words_across(width);
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D, frame.texture);
  kernel_.run({groups_of(64, words), height}, {&out.buffer()},
              {width, words, frame.weights[0], frame.weights[1], frame.weights[2], frame.weights[3],
               frame.alpha, frame.black});
  gl_.BindTexture(GL_TEXTURE_2D, 0);
}

}  // namespace eventcamera::gl
