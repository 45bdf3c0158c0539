// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/gl/kernels.hpp"
#include "src/gl/objects.hpp"
#include "src/gl/simulator.hpp"
#include "tests/gl/egl_context.hpp"

namespace gl_test {

inline std::vector<std::uint8_t> bytes_of(const eventcamera::Image<std::uint8_t>& picture) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < picture.height(); ++y)
    bytes.insert(bytes.end(), picture.row(y), picture.row(y) + picture.width());
  return bytes;
}

/// With OpenGL ES and OpenGL. Instantiated once in each executable.
class EveryApi : public testing::TestWithParam<bool> {
 protected:
  /// Writes a picture to a frame on the GPU.
  void upload(const eventcamera::Image<std::uint8_t>& picture,
              const eventcamera::gl::GreyFrame& frame) {
    Texture texture(picture.width(), picture.height(), 1);
    luma_kernel.run(texture.show(bytes_of(picture)), frame);
  }

  EglContext current{GetParam()};
  eventcamera::gl::Context context{load};
  eventcamera::gl::LumaKernel luma_kernel{context};
};

/// Simulates the next frame, and waits for the events of the interval that it ends, if any.
inline const eventcamera::EventBuckets* events_until(eventcamera::gl::Simulator& simulator,
                                                     const eventcamera::gl::TextureFrame& frame,
                                                     eventcamera::Nanoseconds time,
                                                     const eventcamera::Settings& settings) {
  simulator.queue(frame, time, settings);
  return simulator.read();
}

inline std::string name_of_api(const testing::TestParamInfo<bool>& api) {
  return api.param ? "OpenGLES" : "OpenGL";
}

/// Share of events of `a` for which `b` has one of the same polarity within a pixel and a step.
inline double matched(const std::vector<eventcamera::Event>& a,
                      const std::vector<eventcamera::Event>& b, std::uint32_t step) {
  using eventcamera::Event;
  std::size_t matches = 0;
  for (const auto& event : a) {
    const auto first =
        std::ranges::lower_bound(b, event.t - std::min(event.t, step), {}, &Event::t);
    const auto last = std::ranges::upper_bound(b, event.t + step, {}, &Event::t);
    matches += std::any_of(first, last, [&](const Event& other) {
      return event.polarity() == other.polarity() && std::abs(event.x - other.x) <= 1 &&
             std::abs(event.y() - other.y()) <= 1;
    });
  }
  return static_cast<double>(matches) / static_cast<double>(a.size());
}

}  // namespace gl_test
