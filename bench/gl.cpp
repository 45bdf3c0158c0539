// SPDX-License-Identifier: LGPL-2.1-or-later
// Time per frame of the simulators on the GPU, in its parts, beside those on the CPU: the first
// clip of each scene, scaled to each size. Prints a table.
//   meson devenv -C build-bench bench/gl_bench [WIDTHxHEIGHT...]
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/methods.hpp"
#include "bench/scenes.hpp"
#include "src/gl/simulator.hpp"
#include "tests/gl/egl_context.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;
using bench::Clip;
using bench::Frame;

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Calls `work` and returns its duration, milliseconds.
template <class Work>
double time_of(const Work& work) {
  const auto start = Clock::now();
  work();
  return milliseconds_since(start);
}

/// Frames of a clip, back and forth, that come first and are not timed: drivers compile late, and
/// diff has no difference before the third.
constexpr std::int64_t untimed = 4;

/// Calls `work` with the numbers of the frames to time, for about a second.
template <class Work>
void for_each_timed(const Work& work) {
  const auto start = Clock::now();
  constexpr std::int64_t fewest = 4;
  constexpr std::int64_t most = 20;
  for (auto i = untimed; i < untimed + most; ++i) {
    if (i >= untimed + fewest && milliseconds_since(start) > 1000) break;
    work(i);
  }
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// The frame at another size, by bilinear interpolation.
Frame scaled(const Frame& from, int width, int height) {
  Frame to(width, height);
  for (int y = 0; y < height; ++y) {
    const double v = (from.height() - 1.0) * y / std::max(height - 1, 1);
    const int top = std::min(static_cast<int>(v), from.height() - 2);
    for (int x = 0; x < width; ++x) {
      const double u = (from.width() - 1.0) * x / std::max(width - 1, 1);
      const int left = std::min(static_cast<int>(u), from.width() - 2);
      const double right = u - left;
      const auto row = [&](int at) {
        return from.at(left, at) * (1 - right) + from.at(left + 1, at) * right;
      };
      to.at(x, y) =
          static_cast<std::uint8_t>(row(top) * (1 - (v - top)) + row(top + 1) * (v - top) + 0.5);
    }
  }
  return to;
}

struct Method {
  const bench::Method& cpu;
  std::unique_ptr<gl::Simulator> (*make)(const gl::Context&, const LumaFormat&);
  const char* element;
};

std::unique_ptr<gl::Simulator> make_dense(const gl::Context& gl, const LumaFormat& format) {
  return gl::make_dense_simulator(gl, format);
}

const Method methods[] = {
    {bench::frame_method, gl::make_frame_simulator, "gleventsim-frame"},
    {bench::farneback_method, make_dense, "gleventsim-dense"},
    {bench::sparse_method, gl::make_sparse_simulator, "gleventsim-sparse"},
    {bench::diff_method, gl::make_diff_simulator, "gleventsim-diff"},
};

/// Time on the GPU, by timer queries.
class GpuTimer {
 public:
  GpuTimer() { gen_queries_(1, &query_); }

  /// Milliseconds that the GPU takes for the commands that `work` queues. Waits for it.
  template <class Work>
  double time_of(const Work& work) const {
    constexpr GLenum time_elapsed = 0x88BF;
    begin_query_(time_elapsed, query_);
    work();
    end_query_(time_elapsed);
    GLuint nanoseconds = 0;
    get_result_(query_, GL_QUERY_RESULT, &nanoseconds);
    return nanoseconds / 1e6;
  }

 private:
  PFNGLGENQUERIESPROC gen_queries_ =
      reinterpret_cast<PFNGLGENQUERIESPROC>(gl_test::load("glGenQueries"));
  PFNGLBEGINQUERYPROC begin_query_ =
      reinterpret_cast<PFNGLBEGINQUERYPROC>(gl_test::load("glBeginQuery"));
  PFNGLENDQUERYPROC end_query_ = reinterpret_cast<PFNGLENDQUERYPROC>(gl_test::load("glEndQuery"));
  PFNGLGETQUERYOBJECTUIVPROC get_result_ =
      reinterpret_cast<PFNGLGETQUERYOBJECTUIVPROC>(gl_test::load("glGetQueryObjectuiv"));
  GLuint query_ = 0;
};

/// Milliseconds of a frame, and its events.
struct Costs {
  double upload;
  double call;     ///< that queues the kernels; llvmpipe works in it
  double kernels;  ///< work of the GPU; llvmpipe counts none
  double read;     ///< of the events, when the GPU is done
  double events;
};

Costs costs_of(const gl::Context& context, const Method& method, const Clip& clip,
               const Settings& settings) {
  const auto finish = reinterpret_cast<PFNGLFINISHPROC>(gl_test::load("glFinish"));
  const int width = clip[0].width();
  const int height = clip[0].height();
  const auto simulator = method.make(context, {width, height, 8});
  gl_test::Texture texture(width, height, 1);
  const GpuTimer gpu;
  std::vector<double> upload;
  std::vector<double> call;
  std::vector<double> kernels;
  std::vector<double> read;
  std::vector<double> events;
  const auto play = [&](std::int64_t i) {
    const Frame& frame = bench::back_and_forth(clip, i);
    std::vector<std::uint8_t> bytes;
    for (int y = 0; y < height; ++y) bytes.insert(bytes.end(), frame.row(y), frame.row(y) + width);
    const double uploading = time_of([&] {
      texture.upload(bytes);
      finish();
    });
    double calling = 0;
    const double working = gpu.time_of([&] {
      calling = time_of([&] {
        simulator->queue(texture.frame({LumaWeights::one, 0, 0, 0}), i * bench::frame_time,
                         settings);
      });
    });
    const EventBuckets* made = nullptr;
    const double reading = time_of([&] { made = simulator->read(); });
    if (i < untimed) return;
    upload.push_back(uploading);
    call.push_back(calling);
    kernels.push_back(working);
    read.push_back(reading);
    events.push_back(static_cast<double>(made->size()));
  };
  for (std::int64_t i = 0; i < untimed; ++i) play(i);
  for_each_timed(play);
  return {median(upload), median(call), median(kernels), median(read), median(events)};
}

/// Milliseconds of a frame on the CPU.
double cpu_cost_of(const Method& method, const Clip& clip, const Settings& settings) {
  const auto simulator = method.cpu.ours({clip[0].width(), clip[0].height(), 8});
  const auto play = [&](std::int64_t i) {
    return time_of([&] {
      simulator->push(scene::luma(bench::back_and_forth(clip, i)), i * bench::frame_time, settings);
    });
  };
  for (std::int64_t i = 0; i < untimed; ++i) play(i);
  std::vector<double> times;
  for_each_timed([&](std::int64_t i) { times.push_back(play(i)); });
  return median(times);
}

/// Milliseconds of a frame in a pipeline, from memory to events.
double element_cost_of(const Method& method, const Clip& clip, const Settings& settings) {
  std::string launch = "appsrc name=source format=time block=true max-buffers=1 ! glupload ! ";
  launch += std::string(method.element) +
            " positive-threshold=" + std::to_string(settings.positive_threshold) +
            " negative-threshold=" + std::to_string(settings.negative_threshold);
  if (method.cpu.name != "frame")
    launch += " interpolated-frames=" + std::to_string(settings.interpolated_frames);
  launch += " ! application/x-event-camera ! fakesink sync=false";
  GError* error = nullptr;
  GstElement* pipeline = gst_parse_launch(launch.c_str(), &error);
  if (error != nullptr) throw std::runtime_error(error->message);
  auto* source = GST_APP_SRC(gst_bin_get_by_name(GST_BIN(pipeline), "source"));
  GstVideoInfo video;
  gst_video_info_set_format(&video, GST_VIDEO_FORMAT_GRAY8, static_cast<guint>(clip[0].width()),
                            static_cast<guint>(clip[0].height()));
  GST_VIDEO_INFO_FPS_N(&video) = 25;
  GstCaps* caps = gst_video_info_to_caps(&video);
  gst_app_src_set_caps(source, caps);
  gst_caps_unref(caps);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  const auto push = [&](std::int64_t i) {
    const Frame& frame = bench::back_and_forth(clip, i);
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&video), nullptr);
    for (int y = 0; y < frame.height(); ++y)
      gst_buffer_fill(buffer, static_cast<gsize>(y * GST_VIDEO_INFO_PLANE_STRIDE(&video, 0)),
                      frame.row(y), static_cast<gsize>(frame.width()));
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(i) * bench::frame_time;
    gst_app_src_push_buffer(source, buffer);  // waits until the last one has been taken
  };
  for (std::int64_t i = 0; i < untimed; ++i) push(i);
  const auto start = Clock::now();
  std::int64_t frames = 0;
  for_each_timed([&](std::int64_t i) {
    push(i);
    ++frames;
  });
  gst_app_src_end_of_stream(source);
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* end = gst_bus_timed_pop_filtered(
      bus, GST_CLOCK_TIME_NONE, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  const double time = milliseconds_since(start);
  const bool failed = GST_MESSAGE_TYPE(end) == GST_MESSAGE_ERROR;
  gst_message_unref(end);
  gst_object_unref(bus);
  gst_object_unref(source);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
  if (failed) throw std::runtime_error("the pipeline failed: " + launch);
  return time / static_cast<double>(frames);
}

void print_row(const gl::Context& context, const bench::Scene& scene, const Method& method,
               int width, int height) {
  Clip clip;
  for (const auto& frame : scene.clips[0]) clip.push_back(scaled(frame, width, height));
  const Settings settings{method.cpu.threshold, method.cpu.threshold, scene.interpolated_frames, 0};
  const auto gpu = costs_of(context, method, clip, settings);
  char kernels[32] = "not counted";
  if (gpu.kernels > 0.001) std::snprintf(kernels, sizeof kernels, "%.3g", gpu.kernels);
  std::printf("| %s, %dx%d | %s | %.0f | %.3g | %.3g | %s | %.3g | %.3g | %.3g |\n",
              scene.name.c_str(), width, height, method.cpu.name.c_str(), gpu.events, gpu.upload,
              gpu.call, kernels, gpu.read, element_cost_of(method, clip, settings),
              cpu_cost_of(method, clip, settings));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  std::vector<std::string> sizes(argv + 1, argv + argc);
  if (sizes.empty()) sizes = {"640x480", "1280x720", "1920x1080", "3840x2160"};
  const gl_test::EglContext current(false);
  const gl::Context context(gl_test::load);
  const auto get_string = reinterpret_cast<PFNGLGETSTRINGPROC>(gl_test::load("glGetString"));
  std::printf("Renderer: %s. Milliseconds per frame, medians.\n\n",
              reinterpret_cast<const char*>(get_string(GL_RENDERER)));
  std::printf(
      "| scene | method | events | upload | call | kernels | read-back | element | CPU |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  const auto scenes = bench::scenes(false);
  for (const auto& size : sizes) {
    int width = 0;
    int height = 0;
    if (std::sscanf(size.c_str(), "%dx%d", &width, &height) != 2 || width < 1 || height < 1) {
      std::fprintf(stderr, "gl_bench: '%s' is not a size; give WIDTHxHEIGHT\n", size.c_str());
      return 2;
    }
    for (const auto& scene : scenes)
      for (const auto& method : methods) print_row(context, scene, method, width, height);
  }
}
