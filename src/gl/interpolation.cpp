// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/interpolation.hpp"

#include <algorithm>
#include <bit>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

InterpolationKernel::InterpolationKernel(const Context& gl, const LumaFormat& format)
    : format_(format), kernel_(gl, "interpolate", shaders::interpolate) {}

void InterpolationKernel::run(const GreyFrame& last, const GreyFrame& now, const Buffer& flow,
                              Interpolation interpolation, const Thresholds& thresholds,
                              const EventList& out) const {
  const int steps = out.steps();
  constexpr int max_steps = 64;  // per run, as in the shader
  const int factor = std::bit_cast<int>(65536.0F / static_cast<float>(steps));
  for (int first = 1; first <= steps; first += max_steps)
    kernel_.run({groups_of(64, format_.width), format_.height},
                {&last.buffer(), &now.buffer(), &flow, &out.marks()},
                {format_.width, format_.height, interpolation == Interpolation::blend ? 1 : 0,
                 steps, factor, first, std::min(first + max_steps - 1, steps), thresholds.positive,
                 thresholds.negative});
}

}  // namespace eventcamera::gl
