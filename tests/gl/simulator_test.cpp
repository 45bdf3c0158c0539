// SPDX-License-Identifier: LGPL-2.1-or-later
// The simulators on the GPU against those on the CPU.
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "src/gl/frame.hpp"
#include "src/simulate/frame.hpp"
#include "tests/core/scene.hpp"
#include "tests/gl/egl_context.hpp"

namespace {

using namespace eventcamera;
using gl_test::EglContext;
using gl_test::Texture;

constexpr int one = LumaWeights::one;

std::vector<std::uint8_t> bytes_of(const Image<std::uint8_t>& picture) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < picture.height(); ++y)
    bytes.insert(bytes.end(), picture.row(y), picture.row(y) + picture.width());
  return bytes;
}

/// With OpenGL ES and OpenGL.
class EveryApi : public testing::TestWithParam<bool> {
 protected:
  EglContext current{GetParam()};
  gl::Context context{gl_test::load};
};
INSTANTIATE_TEST_SUITE_P(, EveryApi, testing::Bool(),
                         [](const auto& api) { return api.param ? "OpenGLES" : "OpenGL"; });

/// Pushes grey frames to both simulators and compares the events of each interval.
void expect_same_events(gl::Simulator& ours, Simulator& reference, const Settings& settings,
                        const std::vector<Image<std::uint8_t>>& frames) {
  Texture texture(frames[0].width(), frames[0].height(), 1);
  Nanoseconds time = 5;
  std::size_t events = 0;
  for (const auto& frame : frames) {
    texture.upload(bytes_of(frame));
    const auto* made = ours.push(texture.frame({one, 0, 0, 0}), time, settings);
    const auto* expected = reference.push(scene::luma(frame), time, settings);
    ASSERT_EQ(made == nullptr, expected == nullptr);
    if (made != nullptr) {
      ASSERT_EQ(scene::copy(*made), scene::copy(*expected)) << frame.width();
      events += made->size();
    }
    time += 33'333'333;
  }
  EXPECT_GT(events, 0U);
}

TEST_P(EveryApi, MakesTheEventsOfFrameDifferencesBitForBit) {
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {32, 5}, {33, 40}, {300, 130}}) {
    const LumaFormat format{width, height, 8};
    const auto ours = gl::make_frame_simulator(context, format);
    const auto reference = make_frame_simulator(format);
    for (const auto& [rise, fall] : {std::pair{20.0, 20.0}, {0.0, 255.0}, {254.9, 0.0}}) {
      Settings settings;
      settings.positive_threshold = rise;
      settings.negative_threshold = fall;
      expect_same_events(*ours, *reference, settings,
                         {scene::noise<std::uint8_t>(width, height, 8, 1),
                          scene::noise<std::uint8_t>(width, height, 8, 2),
                          scene::flat<std::uint8_t>(width, height, 255),
                          scene::flat<std::uint8_t>(width, height, 0)});
      ours->reset();
      reference->reset();
    }
  }
}

TEST_P(EveryApi, ComputesTheLumaOfColoursBitForBit) {
  constexpr int width = 61;
  constexpr int height = 50;
  const LumaFormat format{width, height, 8};
  const auto weights = LumaWeights::of(0.2126, 0.0722);
  const auto ours = gl::make_frame_simulator(context, format);
  const auto reference = make_frame_simulator(format);
  std::minstd_rand random(3);
  Settings settings;
  settings.positive_threshold = 0;
  settings.negative_threshold = 0;
  Texture texture(width, height, 4);
  ThreadPool threads;
  for (int i = 0; i < 3; ++i) {
    std::vector<std::uint8_t> bgra(width * height * 4);
    for (auto& byte : bgra) byte = static_cast<std::uint8_t>(random() >> 8);
    Image<std::uint8_t> luma(width, height);
    luma_of_rgb(RgbView{4,
                        {bgra.data(), width * 4, 2},
                        {bgra.data(), width * 4, 1},
                        {bgra.data(), width * 4, 0}},
                weights, threads, luma);
    texture.upload(bgra);
    const auto* made = ours->push(texture.frame({weights.blue, weights.green, weights.red, 0}),
                                  i * scene::frame_time, settings);
    const auto* expected = reference->push(scene::luma(luma), i * scene::frame_time, settings);
    if (i == 0) continue;
    ASSERT_EQ(scene::copy(*made), scene::copy(*expected));
  }
}

TEST(Context, NamesWhatIsMissing) {
  const EglContext current(true);
  const auto message = [](const gl::Context::Load& load) -> std::string {
    try {
      const gl::Context context(load);
    } catch (const gl::Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message(gl_test::load), "");
  EXPECT_EQ(message([](const char* name) -> void* {
              return std::string_view(name) == "glDispatchCompute" ? nullptr : gl_test::load(name);
            }),
            "compute shaders need OpenGL ES 3.1 or OpenGL 4.3, and glDispatchCompute is missing");
  EXPECT_EQ(message([](const char* name) -> void* {
              static const auto version =
                  +[](GLenum) { return reinterpret_cast<const GLubyte*>("OpenGL ES 3.0 Old"); };
              return std::string_view(name) == "glGetString" ? reinterpret_cast<void*>(version)
                                                             : gl_test::load(name);
            }),
            "compute shaders need OpenGL ES 3.1 or OpenGL 4.3, and this is OpenGL ES 3.0 Old");
}

TEST(Kernel, ReportsWhatTheCompilerSays) {
  const EglContext current(true);
  const gl::Context context(gl_test::load);
  try {
    const gl::Kernel kernel(context, "wrong",
                            "layout(local_size_x = 1) in; void main() { x = 1; }");
    FAIL();
  } catch (const gl::Error& error) {
    const std::string text = error.what();
    EXPECT_TRUE(text.starts_with("the driver does not compile the compute shader 'wrong': "));
    EXPECT_NE(text.find("`x' undeclared"), text.npos) << text;
  }
}

}  // namespace
