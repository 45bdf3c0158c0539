// SPDX-License-Identifier: LGPL-2.1-or-later
// Time per frame of the simulators on the GPU, in its parts, beside the CPU: the first clip of each
// scene, scaled to each size. Prints a table.
//   meson devenv -C build-bench bench/gl_bench [OPTION...] [WIDTHxHEIGHT...]
//   --quick      fewer scenes and frames: a few minutes on a GPU
//   --passes     also prints the time of each kernel
//   --json=FILE  writes all figures
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "bench/methods.hpp"
#include "bench/scenes.hpp"
#include "src/flow/opencv.hpp"
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

/// Warm-up frames: drivers compile late, and diff tracks from the third frame on.
constexpr std::int64_t untimed = 4;

double max_duration = 1000;  ///< of a measurement, milliseconds

/// Calls `work` with the numbers of the frames to time.
template <class Work>
void for_each_timed(const Work& work) {
  const auto start = Clock::now();
  constexpr std::int64_t min_frames = 4;
  constexpr std::int64_t max_frames = 20;
  for (auto i = untimed; i < untimed + max_frames; ++i) {
    if (i >= untimed + min_frames && milliseconds_since(start) > max_duration) break;
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
  cv::Mat out(height, width, CV_8U, to.row(0), static_cast<std::size_t>(to.stride()));
  cv::resize(opencv_image(from.view()), out, out.size());
  return to;
}

struct Method {
  bench::Method cpu;
  std::unique_ptr<gl::Simulator> (*make)(const gl::Context&, const LumaFormat&);
  const char* element;
};

std::unique_ptr<gl::Simulator> make_dense(const gl::Context& gl, const LumaFormat& format) {
  return gl::make_dense_simulator(gl, format);
}

template <DvsPreset preset>
std::unique_ptr<gl::Simulator> make_dvs(const gl::Context& gl, const LumaFormat& format) {
  auto simulator = gl::make_dvs_simulator(gl, format);
  simulator->set(settings_of(preset));
  return simulator;
}

const Method methods[] = {
    {bench::frame_method, gl::make_frame_simulator, "gleventsim-frame"},
    {bench::farneback_method, make_dense, "gleventsim-dense"},
    {bench::sparse_method, gl::make_sparse_simulator, "gleventsim-sparse"},
    {bench::diff_method, gl::make_diff_simulator, "gleventsim-diff"},
    {bench::dvs_method("dvs-esim", settings_of(DvsPreset::esim)), make_dvs<DvsPreset::esim>,
     "gleventsim-dvs preset=esim"},
    {bench::dvs_method("dvs", settings_of(DvsPreset::standard)), make_dvs<DvsPreset::standard>,
     "gleventsim-dvs"},
};

/// GPU time of all runs of a kernel in a frame.
struct Pass {
  int runs;
  double time;  ///< milliseconds
};
using Passes = std::map<std::string, Pass>;

/// Times commands on the GPU by timestamps.
class GpuTimer {
 public:
  explicit GpuTimer(gl::Context& gl) : gl_(gl) {}
  ~GpuTimer() { gl_.on_kernel = nullptr; }
  GpuTimer(const GpuTimer&) = delete;
  GpuTimer& operator=(const GpuTimer&) = delete;

  /// Also times each kernel, from its start to the start of the next one.
  void time_kernels() {
    gl_.on_kernel = [this](std::string_view kernel) { mark(std::string(kernel)); };
  }

  /// Returns the GPU time of the commands that `work` queues, milliseconds. Waits for the GPU.
  template <class Work>
  double time_of(const Work& work) {
    names_.clear();
    mark("");
    work();
    end_ = names_.size();
    mark("");
    return time_between(0, end_);
  }

  /// Times of the kernels in the last time_of().
  Passes passes() const {
    Passes passes;
    for (std::size_t i = 1; i < end_; ++i) {
      auto& [runs, time] = passes[names_[i]];
      ++runs;
      time += time_between(i, i + 1);
    }
    return passes;
  }

 private:
  void mark(const std::string& kernel) {
    constexpr GLenum timestamp = 0x8E28;
    names_.push_back(kernel);
    if (names_.size() > queries_.size()) gen_queries_(1, &queries_.emplace_back());
    query_counter_(queries_[names_.size() - 1], timestamp);
  }

  double time_between(std::size_t first, std::size_t last) const {
    GLuint64 times[2] = {};
    get_result_(queries_[first], GL_QUERY_RESULT, &times[0]);
    get_result_(queries_[last], GL_QUERY_RESULT, &times[1]);
    return static_cast<double>(times[1] - times[0]) / 1e6;
  }

  gl::Context& gl_;
  std::vector<std::string> names_;  ///< of the kernels that start at each timestamp
  std::size_t end_ = 0;             ///< timestamp of the end; read() may run kernels later
  std::vector<GLuint> queries_;
  PFNGLGENQUERIESPROC gen_queries_ =
      reinterpret_cast<PFNGLGENQUERIESPROC>(gl_test::load("glGenQueries"));
  using QueryCounter = void(GL_APIENTRY*)(GLuint, GLenum);
  using GetResult = void(GL_APIENTRY*)(GLuint, GLenum, GLuint64*);
  QueryCounter query_counter_ = reinterpret_cast<QueryCounter>(gl_test::load("glQueryCounter"));
  GetResult get_result_ = reinterpret_cast<GetResult>(gl_test::load("glGetQueryObjectui64v"));
};

/// Milliseconds per frame, and number of events.
struct Costs {
  double upload;
  double call;     ///< to queue the kernels; llvmpipe runs them in it
  double kernels;  ///< on the GPU
  double read;     ///< to copy the events, once the GPU has finished
  double events;
  Passes passes;
};

Costs costs_of(gl::Context& context, const Method& method, const Clip& clip,
               const Settings& settings, bool has_passes) {
  const auto finish = reinterpret_cast<PFNGLFINISHPROC>(gl_test::load("glFinish"));
  const int width = clip[0].width();
  const int height = clip[0].height();
  const auto simulator = method.make(context, {width, height, 8});
  gl_test::Texture texture(width, height, 1);
  GpuTimer gpu(context);
  std::vector<double> upload;
  std::vector<double> call;
  std::vector<double> kernels;
  std::vector<double> read;
  std::vector<double> events;
  const auto play = [&](std::int64_t i) {
    const Frame& frame = bench::back_and_forth(clip, i);
    std::vector<std::uint8_t> bytes;
    for (int y = 0; y < height; ++y) bytes.insert(bytes.end(), frame.row(y), frame.row(y) + width);
    upload.push_back(time_of([&] {
      texture.upload(bytes);
      finish();
    }));
    kernels.push_back(gpu.time_of([&] {
      call.push_back(
          time_of([&] { simulator->queue(texture.frame(), i * bench::frame_time, settings); }));
    }));
    const EventBuckets* made = nullptr;
    read.push_back(time_of([&] { made = simulator->read(); }));
    events.push_back(made == nullptr ? 0 : static_cast<double>(made->size()));
  };
  for (std::int64_t i = 0; i < untimed; ++i) play(i);
  for (auto* times : {&upload, &call, &kernels, &read, &events}) times->clear();
  std::int64_t next = untimed;
  for_each_timed([&](std::int64_t i) {
    play(i);
    next = i + 1;
  });
  Costs costs{median(upload), median(call), median(kernels), median(read), median(events), {}};
  if (!has_passes) return costs;
  gpu.time_kernels();
  std::map<std::string, std::vector<double>> times;
  for_each_timed([&](std::int64_t) {
    play(next++);
    for (const auto& [name, pass] : gpu.passes()) {
      costs.passes[name].runs = pass.runs;
      times[name].push_back(pass.time);
    }
  });
  for (auto& [name, pass] : costs.passes) pass.time = median(times[name]);
  return costs;
}

/// Milliseconds per frame on the CPU.
double cpu_cost_of(const Method& method, const Clip& clip, const Settings& settings) {
  const auto simulator = method.cpu.make({clip[0].width(), clip[0].height(), 8});
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

/// Milliseconds per frame in a pipeline, from memory to events.
double element_cost_of(const Method& method, const Clip& clip, const Settings& settings) {
  std::string launch = "appsrc name=source format=time block=true max-buffers=1 ! glupload ! ";
  launch += method.element;
  if (method.cpu.threshold > 0)  // else they are those of the preset
    launch += " positive-threshold=" + std::to_string(settings.positive_threshold) +
              " negative-threshold=" + std::to_string(settings.negative_threshold);
  if (method.cpu.threshold > 0 && method.cpu.name != "frame")
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
      gst_buffer_fill(
          buffer,
          static_cast<gsize>(y) * static_cast<gsize>(GST_VIDEO_INFO_PLANE_STRIDE(&video, 0)),
          frame.row(y), static_cast<gsize>(frame.width()));
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(i) * bench::frame_time;
    gst_app_src_push_buffer(source, buffer);  // blocks until the last one is taken
  };
  // When a frame has been pushed, the last but one has passed the simulator.
  constexpr std::int64_t in_flight = 2;
  for (std::int64_t i = 0; i < untimed + in_flight; ++i) push(i);
  const auto start = Clock::now();
  std::int64_t frames = in_flight;
  for_each_timed([&](std::int64_t i) {
    push(i + in_flight);
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

/// Prints rows of the tables, and writes a file of all figures.
class Report {
 public:
  Report(gl::Context& context, bool has_passes, const std::string& json_path)
      : context_(context), has_passes_(has_passes) {
    const auto get_string = reinterpret_cast<PFNGLGETSTRINGPROC>(gl_test::load("glGetString"));
    const auto text = [&](GLenum name) { return reinterpret_cast<const char*>(get_string(name)); };
    std::printf(
        "Renderer: %s, OpenGL %s. Milliseconds per frame, medians.\n\n"
        "| scene | method | events | upload | call | kernels | read-back | element | CPU |\n"
        "|---|---|---|---|---|---|---|---|---|\n",
        text(GL_RENDERER), text(GL_VERSION));
    if (json_path.empty()) return;
    json_.reset(std::fopen(json_path.c_str(), "w"));
    if (json_ == nullptr) throw std::runtime_error("cannot write " + json_path);
    std::fprintf(json_.get(), "{\"renderer\": \"%s\", \"version\": \"%s\", \"rows\": [",
                 text(GL_RENDERER), text(GL_VERSION));
  }

  void measure(const std::string& scene, const Method& method, const Clip& clip,
               const Settings& settings) {
    const auto gpu = costs_of(context_, method, clip, settings, has_passes_);
    const double element = element_cost_of(method, clip, settings);
    const double cpu = cpu_cost_of(method, clip, settings);
    std::printf("| %s | %s | %.0f | %.3g | %.3g | %.3g | %.3g | %.3g | %.3g |\n", scene.c_str(),
                method.cpu.name.c_str(), gpu.events, gpu.upload, gpu.call, gpu.kernels, gpu.read,
                element, cpu);
    std::fflush(stdout);
    if (has_passes_) passes_.push_back(row_of_passes(scene, method, gpu));
    if (json_ == nullptr) return;
    std::fprintf(json_.get(),
                 "%s\n  {\"scene\": \"%s\", \"method\": \"%s\", \"events\": %.0f, \"upload\": %g, "
                 "\"call\": %g, \"kernels\": %g, \"read-back\": %g, \"element\": %g, \"cpu\": %g, "
                 "\"passes\": {",
                 rows_++ > 0 ? "," : "", scene.c_str(), method.cpu.name.c_str(), gpu.events,
                 gpu.upload, gpu.call, gpu.kernels, gpu.read, element, cpu);
    const char* separator = "";
    for (const auto& [name, pass] : gpu.passes) {
      std::fprintf(json_.get(), "%s\"%s\": {\"runs\": %d, \"time\": %g}", separator, name.c_str(),
                   pass.runs, pass.time);
      separator = ", ";
    }
    std::fprintf(json_.get(), "}}");
  }

  void finish() {
    if (has_passes_)
      std::printf(
          "\nPasses: milliseconds per frame of each kernel and of reading back, with the runs of "
          "kernels.\n\n| scene | method | passes |\n|---|---|---|\n");
    for (const auto& row : passes_) std::printf("%s\n", row.c_str());
    if (json_ != nullptr) std::fprintf(json_.get(), "\n]}\n");
  }

 private:
  static std::string row_of_passes(const std::string& scene, const Method& method,
                                   const Costs& costs) {
    std::vector<std::pair<double, std::string>> passes{{costs.read, "read-back"}};
    for (const auto& [name, pass] : costs.passes)
      passes.emplace_back(pass.time, name + " ×" + std::to_string(pass.runs));
    std::ranges::sort(passes, std::ranges::greater());
    std::string row = "| " + scene + " | " + method.cpu.name + " |";
    const char* separator = " ";
    for (const auto& [time, name] : passes) {
      char figure[32];
      std::snprintf(figure, sizeof figure, " %.3g", time);
      row += separator + name + figure;
      separator = ", ";
    }
    return row + " |";
  }

  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  gl::Context& context_;
  bool has_passes_;
  std::unique_ptr<std::FILE, Close> json_;
  int rows_ = 0;
  std::vector<std::string> passes_;  ///< rows of the second table
};

/// A scene's name without its size.
std::string name_of(const bench::Scene& scene) {
  return scene.name.substr(0, scene.name.rfind('-'));
}

/// The clips to time; scenes without recordings are generated.
std::vector<bench::Scene> scenes_to_time(bool is_quick) {
  std::vector<bench::Scene> scenes;
  if (is_quick) {
    if (auto driving = bench::driving(640, 480, false)) scenes.push_back(std::move(*driving));
    scenes.push_back({"ball-1280x720", {bench::ball(7)}, 10});
  } else {
    scenes = bench::scenes(false);
  }
  scenes.push_back({"texture-640x480", {bench::moving_patch(640, 480, 1, 7)}, 10});
  return scenes;
}

}  // namespace

int main(int argc, char** argv) try {
  gst_init(&argc, &argv);
  bool is_quick = false;
  bool has_passes = false;
  std::string json_path;
  std::vector<std::pair<int, int>> sizes;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    auto& [width, height] = sizes.emplace_back();
    if (std::sscanf(argv[i], "%dx%d", &width, &height) == 2 && width > 0 && height > 0) continue;
    sizes.pop_back();
    if (argument == "--quick") {
      is_quick = true;
    } else if (argument == "--passes") {
      has_passes = true;
    } else if (argument.starts_with("--json=")) {
      json_path = argument.substr(std::strlen("--json="));
    } else {
      std::fprintf(stderr,
                   "gl_bench: '%s' is neither a size, WIDTHxHEIGHT, nor --quick, --passes or "
                   "--json=FILE\n",
                   argv[i]);
      return 2;
    }
  }
  if (sizes.empty()) {
    sizes = {{640, 480}, {1280, 720}, {3840, 2160}};
    if (!is_quick) sizes.insert(sizes.begin() + 2, {1920, 1080});
  }
  if (is_quick) max_duration = 300;
  const gl_test::EglContext current(false);
  gl::Context context(gl_test::load);
  Report report(context, has_passes, json_path);
  const auto scenes = scenes_to_time(is_quick);
  for (const auto& [width, height] : sizes) {
    for (const auto& scene : scenes) {
      Clip clip;
      for (const auto& frame : scene.clips[0]) clip.push_back(scaled(frame, width, height));
      const int n = scene.interpolated_frames;
      const auto title = name_of(scene) + ", " + std::to_string(width) + "x" +
                         std::to_string(height) + ", n = " + std::to_string(n);
      for (const auto& method : methods)
        report.measure(title, method, clip, {method.cpu.threshold, method.cpu.threshold, n, 0});
    }
  }
  report.finish();
} catch (const std::exception& error) {
  std::fprintf(stderr, "gl_bench: %s\n", error.what());
  return 1;
}
