// SPDX-License-Identifier: LGPL-2.1-or-later
// The simulators on the GPU against those on the CPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/gl/kernels.hpp"
#include "src/gl/point_tracker.hpp"
#include "src/gl/simulator.hpp"
#include "src/render/accumulator.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/gl/every_api.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using gl_test::bytes_of;
using gl_test::EglContext;
using gl_test::EveryApi;
using gl_test::matched;
using gl_test::Texture;

INSTANTIATE_TEST_SUITE_P(, EveryApi, testing::Bool(), gl_test::name_of_api);

/// Pushes grey frames to both simulators and compares the events of each interval.
void expect_same_events(gl::Simulator& ours, Simulator& reference, const Settings& settings,
                        const std::vector<Image<std::uint8_t>>& frames) {
  Texture texture(frames[0].width(), frames[0].height(), 1);
  Nanoseconds time = 5;
  std::size_t events = 0;
  for (const auto& frame : frames) {
    const auto* made = gl_test::events_until(ours, texture.show(bytes_of(frame)), time, settings);
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

TEST_P(EveryApi, MakesTheEventsOfTheCpuWhereNothingIsInterpolated) {
  const LumaFormat format{67, 45, 8};
  const Settings settings{12, 9, 0};
  std::vector<Image<std::uint8_t>> frames;
  for (int i = 0; i < 3; ++i)
    frames.push_back(scene::texture<std::uint8_t>(67, 45, 8, 1.7 * i, 0.6 * i));
  expect_same_events(*gl::make_diff_simulator(context, format), *make_diff_simulator(format),
                     settings, frames);
  expect_same_events(*gl::make_sparse_simulator(context, format), *make_sparse_simulator(format),
                     settings, frames);
}

/// A patch of a texture that moves over a flat background.
Image<std::uint8_t> patch(int side, int i) {
  auto frame = scene::flat<std::uint8_t>(side, side, 90);
  const auto texture = scene::texture<std::uint8_t>(40, 24, 8, 0, 0);
  for (int y = 0; y < texture.height(); ++y)
    for (int x = 0; x < texture.width(); ++x) frame.at(200 + 3 * i + x, 300 + y) = texture.at(x, y);
  return frame;
}

TEST_P(EveryApi, InterpolatesMoreStepsThanItProcessesAtOnce) {
  constexpr int side = 512;
  const LumaFormat format{side, side, 8};
  const Settings settings{
      .positive_threshold = 6, .negative_threshold = 6, .interpolated_frames = 279};
  ASSERT_EQ(gl::steps_at_once(format, settings.interpolated_frames), 128);
  Texture texture(side, side, 1);
  for (const bool is_sparse : {false, true}) {
    const auto ours = is_sparse ? gl::make_sparse_simulator(context, format)
                                : gl::make_diff_simulator(context, format);
    const auto reference = is_sparse ? make_sparse_simulator(format) : make_diff_simulator(format);
    for (int i = is_sparse ? 1 : 0; i < 3; ++i) {  // diff interpolates from the third frame on
      const auto time = i * scene::frame_time;
      const auto* made =
          gl_test::events_until(*ours, texture.show(bytes_of(patch(side, i))), time, settings);
      const auto* expected = reference->push(scene::luma(patch(side, i)), time, settings);
      if (i < 2) continue;
      const auto events = scene::copy(*made);
      const auto wanted = scene::copy(*expected);
      EXPECT_GT(wanted.size(), 1'000U);
      EXPECT_GE(matched(events, wanted, 0), 0.99) << is_sparse;
      EXPECT_GE(matched(wanted, events, 0), 0.99) << is_sparse;
    }
  }
}

/// The picture that the CPU draws of these events.
std::vector<std::uint8_t> drawn(const EventBuckets* events, const Palette& palette,
                                const LumaFormat& format) {
  Accumulator accumulator(format.width, format.height);
  ThreadPool threads;
  if (events != nullptr) accumulator.add(*events, threads);
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(format.width) *
                                   static_cast<std::size_t>(format.height) * 4);
  accumulator.draw(palette, {.bytes = 4}, reinterpret_cast<std::byte*>(pixels.data()),
                   std::ptrdiff_t{format.width} * 4, threads);
  return pixels;
}

std::unique_ptr<gl::Simulator> make_dvs(const gl::Context& gl, const LumaFormat& format) {
  return gl::make_dvs_simulator(gl, format);
}

TEST_P(EveryApi, DrawsItsEventsAsTheCpuDoes) {
  for (const auto make :
       {gl::make_frame_simulator, gl::make_sparse_simulator, gl::make_diff_simulator, make_dvs}) {
    for (const auto& [width, height] : {std::pair{1, 1}, {33, 21}, {67, 45}, {2100, 3}}) {
      const LumaFormat format{width, height, 8};
      const auto drawing = make(context, format);
      const auto listing = make(context, format);
      Texture texture(width, height, 1);
      Texture picture(width, height, 4);
      picture.upload(std::vector<std::uint8_t>(drawn(nullptr, {}, format).size(), 77));
      const auto& colours = palette(PaletteName::dark);
      Settings settings;
      settings.positive_threshold = 3;
      settings.negative_threshold = 4;
      for (int i = 0; i < 4; ++i) {
        const auto frame = texture.show(
            bytes_of(scene::texture<std::uint8_t>(width, height, 8, 1.7 * i, 0.6 * i)));
        const Nanoseconds time = i * scene::frame_time;
        drawing->draw(frame, time, settings,
                      {picture.name(), pixels_by_kind(colours, {.bytes = 4})});
        EXPECT_EQ(drawing->read(), nullptr);
        const auto* events = gl_test::events_until(*listing, frame, time, settings);
        ASSERT_EQ(picture.download(), drawn(events, colours, format)) << width << " " << i;
        if (i == 2) {  // a first frame again
          drawing->reset();
          listing->reset();
        }
      }
    }
  }
}

TEST_P(EveryApi, TracksPointsAsTheCpuDoes) {
  constexpr int width = 83;
  constexpr int height = 70;
  const LumaFormat format{width, height, 8};
  const auto from = scene::texture<std::uint8_t>(width, height, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(width, height, 8, 2.3, -1.6);
  for (const int block_side : {1, 2}) {
    SCOPED_TRACE(block_side);
    const gl::PointTracker tracker(context, format, block_side);
    const gl::Pyramid pyramids[] = {{context, format}, {context, format}};
    for (const auto& [pyramid, picture] : {std::pair{&pyramids[0], &from}, {&pyramids[1], &to}}) {
      upload(*picture, pyramid->picture());
      tracker.build(*pyramid);
    }
    struct {
      float x;
      float y;
    } tracks[width * height];
    gl::Buffer points(context, GL_DYNAMIC_READ);
    points.reserve(sizeof tracks);
    tracker.find_points(pyramids[0], points);
    tracker.track(pyramids[0], pyramids[1], points);
    points.read(std::as_writable_bytes(std::span(tracks)));

    PointTracker reference(block_side);
    ThreadPool threads;
    reference.push(from.view(), threads);
    reference.push(to.view(), threads);
    std::vector<Point> places;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (from.at(x, y) != 0) places.push_back({x, y});
    const auto expected = reference.track(places, threads);
    double sum = 0;
    int differences = 0;
    int found = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto& track = tracks[places[i].y * width + places[i].x];
      const bool is_found = std::bit_cast<std::uint32_t>(track.x) != 0x7fffffff;
      differences += is_found != expected[i].found;
      if (!is_found || !expected[i].found) continue;
      ++found;
      sum += std::hypot(track.x - expected[i].flow.x, track.y - expected[i].flow.y);
    }
    EXPECT_GT(found, 5'000);
    EXPECT_LE(differences, static_cast<int>(places.size()) / 200);
    EXPECT_LE(sum / found, 0.02);
    RecordProperty("mean_difference_" + std::to_string(block_side), std::to_string(sum / found));
  }
}

/// What work() throws; empty for nothing.
std::string error_of(const auto& work) {
  try {
    work();
  } catch (const gl::Error& error) {
    return error.what();
  }
  return "";
}

TEST(Context, NamesWhatIsMissing) {
  const EglContext current(true);
  const auto message = [](const gl::Context::Load& load) {
    return error_of([&] { const gl::Context context(load); });
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

template <class Function>
Function driver(const char* name) {
  return reinterpret_cast<Function>(gl_test::load(name));
}

/// Calls that wait for the GPU, or would copy what it has not yet written.
int waits = 0;
int releases = 0;
bool is_gpu_busy = false;

void* load_counting_waits(const char* name) {
  const std::string_view function = name;
  if (function == "eglClientWaitSyncKHR")
    return reinterpret_cast<void*>(
        +[](EGLDisplay display, EGLSyncKHR sync, EGLint flags, EGLTimeKHR timeout) -> EGLint {
          waits += timeout > 0;
          if (timeout == 0 && is_gpu_busy) return EGL_TIMEOUT_EXPIRED_KHR;
          return eglClientWaitSync(display, sync, flags, timeout);
        });
  if (function == "glMapBufferRange")
    return reinterpret_cast<void*>(+[](GLenum target, GLintptr offset, GLsizeiptr length,
                                       GLbitfield access) -> void* {
      ++waits;
      return driver<PFNGLMAPBUFFERRANGEPROC>("glMapBufferRange")(target, offset, length, access);
    });
  if (function == "eglReleaseThread")
    return reinterpret_cast<void*>(+[]() -> EGLBoolean {
      ++releases;
      return eglReleaseThread();
    });
  return gl_test::load(name);
}

TEST(Simulator, LeavesNoDataOfEglInAThreadThatWaits) {
  const EglContext current(false);
  const gl::Context context(load_counting_waits);
  const auto simulator = gl::make_frame_simulator(context, {64, 48, 8});
  Texture texture(64, 48, 1);
  simulator->queue(texture.show(bytes_of(scene::noise<std::uint8_t>(64, 48, 8, 1))), 0, {});
  releases = 0;
  simulator->wait();  // this thread keeps its context
  EXPECT_EQ(releases, 0);
  std::thread([&] { simulator->wait(); }).join();
  EXPECT_EQ(releases, 1);
  EXPECT_EQ(simulator->read(), nullptr);
}

TEST(Simulator, ReadsEventsBackWhileTheGpuWorksOnTheNextFrame) {
  const EglContext current(false);
  const gl::Context context(load_counting_waits);
  const LumaFormat format{130, 61, 8};
  Texture texture(format.width, format.height, 1);
  const auto frame_of = [&](unsigned i) {
    return texture.show(bytes_of(scene::noise<std::uint8_t>(format.width, format.height, 8, i)));
  };
  using Make = std::unique_ptr<gl::Simulator> (*)(const gl::Context&, const LumaFormat&);
  const Make make_dense = [](const gl::Context& gl, const LumaFormat& of) {
    return std::unique_ptr<gl::Simulator>(gl::make_dense_simulator(gl, of));
  };
  for (const auto& [make, threshold] : {std::pair<Make, double>{gl::make_frame_simulator, 20},
                                        {make_dense, 20},
                                        {gl::make_sparse_simulator, 200},
                                        {gl::make_diff_simulator, 200}}) {
    const Settings settings{threshold, threshold};
    const auto waiting = make(context, format);
    const auto simulator = make(context, format);
    std::vector<std::vector<Event>> expected;
    for (unsigned i = 0; i < 4; ++i)
      if (const auto* events =
              gl_test::events_until(*waiting, frame_of(i), i * scene::frame_time, settings))
        expected.push_back(scene::copy(*events));
    std::vector<std::vector<Event>> made;
    for (unsigned i = 0; i < 4; ++i) {
      waits = 0;
      is_gpu_busy = true;
      simulator->queue(frame_of(i), i * scene::frame_time, settings);
      EXPECT_EQ(waits, 0);
      is_gpu_busy = false;
      const auto* events = i > 0 ? simulator->read() : nullptr;
      EXPECT_EQ(events == nullptr, i <= 1);
      if (events != nullptr) made.push_back(scene::copy(*events));
    }
    waits = 0;
    made.push_back(scene::copy(*simulator->read()));
    EXPECT_GT(waits, 0);
    EXPECT_EQ(made, expected);
  }
}

/// What a lost context does, as drivers differ.
enum class Loss { none, error, reset, no_mapping, no_wait, garbage };
Loss loss = Loss::none;
bool has_egl = true;

/// The functions of a context that can be lost.
void* load_losable(const char* name) {
  const std::string_view function = name;
  if (function == "glGetError")
    return reinterpret_cast<void*>(+[]() -> GLenum {
      constexpr GLenum context_lost = 0x0507;
      return loss == Loss::error ? context_lost : driver<PFNGLGETERRORPROC>("glGetError")();
    });
  if (function == "glGetGraphicsResetStatus")
    return reinterpret_cast<void*>(+[]() -> GLenum {
      constexpr GLenum unknown_reset = 0x8255;
      return loss == Loss::reset ? unknown_reset : GL_NO_ERROR;
    });
  if (function.starts_with("egl") && !has_egl) return nullptr;
  if (function == "eglClientWaitSyncKHR")
    return reinterpret_cast<void*>(+[](EGLDisplay display, EGLSyncKHR sync, EGLint flags,
                                       EGLTimeKHR timeout) -> EGLint {
      return loss == Loss::no_wait ? EGL_FALSE : eglClientWaitSync(display, sync, flags, timeout);
    });
  if (function == "glClientWaitSync")
    return reinterpret_cast<void*>(+[](GLsync sync, GLbitfield flags, GLuint64 timeout) -> GLenum {
      return loss == Loss::no_wait
                 ? GL_WAIT_FAILED
                 : driver<PFNGLCLIENTWAITSYNCPROC>("glClientWaitSync")(sync, flags, timeout);
    });
  if (function == "glMapBufferRange")
    return reinterpret_cast<void*>(+[](GLenum target, GLintptr offset, GLsizeiptr length,
                                       GLbitfield access) -> void* {
      static constinit std::uint64_t garbage[] = {~0ULL, ~0ULL};
      if (loss == Loss::no_mapping) return nullptr;
      if (loss == Loss::garbage) return garbage;
      return driver<PFNGLMAPBUFFERRANGEPROC>("glMapBufferRange")(target, offset, length, access);
    });
  return gl_test::load(name);
}

/// Contexts with fences of EGL, and without.
class EveryFence : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(, EveryFence, testing::Bool(),
                         [](const auto& egl) { return egl.param ? "Egl" : "OpenGL"; });

TEST_P(EveryFence, ReportsALostContext) {
  has_egl = GetParam();
  const EglContext current(true);
  const gl::Context context(load_losable);
  const LumaFormat format{33, 21, 8};
  constexpr const char* lost = "the OpenGL context was lost, because the GPU was reset or removed";
  const std::pair<Loss, const char*> losses[] = {
      {Loss::error, lost},
      {Loss::reset, lost},
      {Loss::no_mapping, "cannot map an OpenGL buffer"},
      {Loss::no_wait, "OpenGL cannot wait for the GPU"},
      {Loss::garbage, "OpenGL returned more events than there are pixels"}};
  Texture texture(33, 21, 1);
  Texture picture(33, 21, 4);
  picture.upload(std::vector<std::uint8_t>(33 * 21 * 4));
  for (const auto make :
       {gl::make_frame_simulator, gl::make_sparse_simulator, gl::make_diff_simulator}) {
    for (const auto& [what, expected] : losses) {
      for (const bool draws : {false, true}) {
        if (draws && expected != lost) continue;  // reads nothing
        const auto simulator = make(context, format);
        int i = 0;
        const auto push = [&] {
          const auto frame = texture.show(bytes_of(scene::noise<std::uint8_t>(33, 21, 8, ++i)));
          if (draws) {
            simulator->draw(frame, i * scene::frame_time, {}, {picture.name(), {}});
            simulator->drop();
          } else {
            gl_test::events_until(*simulator, frame, i * scene::frame_time, {});
          }
        };
        push();
        push();
        loss = what;
        EXPECT_EQ(error_of(push), expected);
        loss = Loss::none;
        while (context.GetError() != GL_NO_ERROR) continue;  // a buffer was not mapped
      }
    }
  }
  loss = Loss::reset;
  EXPECT_EQ(error_of([&] { const gl::Kernel kernel(context, "wrong", "wrong"); }), lost);
  loss = Loss::error;
  EXPECT_EQ(error_of([&] { context.forget_errors(); }), lost);
  loss = Loss::none;
}

TEST(Kernel, ReportsWhatTheCompilerSays) {
  const EglContext current(true);
  const gl::Context context(gl_test::load);
  const auto text = error_of([&] {
    const gl::Kernel kernel(context, "wrong",
                            "layout(local_size_x = 1) in; void main() { x = 1; }");
  });
  EXPECT_TRUE(text.starts_with("the driver cannot compile the compute shader 'wrong': "));
  EXPECT_TRUE(text.find("undeclared") != text.npos || text.find("undefined") != text.npos)
      << text;  // the words of Mesa and of NVIDIA
}

}  // namespace
