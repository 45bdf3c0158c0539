// SPDX-License-Identifier: LGPL-2.1-or-later
// Overhead of GStreamer per frame: a whole pipeline compared to the core alone, and events written
// and drawn compared to a memcpy of the same bytes. Both sides of a comparison alternate in one
// run. Counters are medians: microseconds per frame, and ratios of wall-clock and CPU time.
//   meson devenv -C build-bench bench/element_bench
#include <benchmark/benchmark.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/scenes.hpp"
#include "src/render/accumulator.hpp"
#include "src/simulate/dense.hpp"
#include "src/simulate/frame.hpp"
#include "tests/core/scene.hpp"

namespace {

using namespace eventcamera;

struct Scene {
  std::string name;
  bench::Clip clip;
};

/// Drifting texture.
Scene drift() {
  Scene scene{"drift-640x480", {}};
  for (int i = 0; i < 12; ++i)
    scene.clip.push_back(scene::texture<std::uint8_t>(640, 480, 8, 1.7 * i, 0.6 * i));
  return scene;
}

struct Method {
  std::string element;  ///< with properties, as in a launch line
  std::unique_ptr<Simulator> (*make)(const LumaFormat& format);
  double threshold;
  int frames_per_turn;
};

constexpr int interpolated_frames = 10;

/// `appsrc ! ELEMENT ! fakesink`, fed from memory.
class Pipeline {
 public:
  Pipeline(const Scene& scene, const Method& method, const std::string& out, int threads)
      : scene_(scene) {
    const std::string launch = "appsrc name=source format=time ! " + method.element +
                               " n-threads=" + std::to_string(threads) +
                               " positive-threshold=" + std::to_string(method.threshold) +
                               " negative-threshold=" + std::to_string(method.threshold) + " ! " +
                               out + " ! fakesink sync=false";
    GError* error = nullptr;
    pipeline_ = gst_parse_launch(launch.c_str(), &error);
    if (error != nullptr) {
      std::fprintf(stderr, "%s: %s\n", launch.c_str(), error->message);
      std::exit(1);
    }
    source_ = GST_APP_SRC(gst_bin_get_by_name(GST_BIN(pipeline_), "source"));
    const auto& first = scene.clip.front();
    GstCaps* caps = gst_caps_new_simple(
        "video/x-raw", "format", G_TYPE_STRING, "GRAY8", "width", G_TYPE_INT, first.width(),
        "height", G_TYPE_INT, first.height(), "framerate", GST_TYPE_FRACTION, 25, 1, nullptr);
    gst_app_src_set_caps(source_, caps);
    gst_caps_unref(caps);
    GstAppSrcCallbacks callbacks = {};
    callbacks.need_data = [](GstAppSrc*, guint, gpointer self) {
      static_cast<Pipeline*>(self)->push_another();
    };
    gst_app_src_set_callbacks(source_, &callbacks, this, nullptr);

    gst_element_set_state(pipeline_, GST_STATE_PLAYING);
    wants_more_.wait(false);
  }
  ~Pipeline() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(source_);
    gst_object_unref(pipeline_);
  }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Pushes `frames` frames and returns when the pipeline wants more.
  void run(int frames) {
    wants_more_ = false;
    left_ = frames - 1;
    push();
    wants_more_.wait(false);
  }

 private:
  void push() {
    const auto& frame = bench::back_and_forth(scene_.clip, pushed_);
    gsize offsets[GST_VIDEO_MAX_PLANES] = {};
    gint strides[GST_VIDEO_MAX_PLANES] = {static_cast<gint>(frame.stride())};
    const auto size = static_cast<gsize>(frame.stride()) * static_cast<gsize>(frame.height());
    GstBuffer* buffer = gst_buffer_new_wrapped_full(GST_MEMORY_FLAG_READONLY,
                                                    const_cast<std::uint8_t*>(frame.row(0)), size,
                                                    0, size, nullptr, nullptr);
    gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8,
                                   static_cast<guint>(frame.width()),
                                   static_cast<guint>(frame.height()), 1, offsets, strides);
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(pushed_++ * scene::frame_time);
    gst_app_src_push_buffer(source_, buffer);
  }
  /// Called once the pipeline has processed all frames.
  void push_another() {
    if (left_ > 0) {
      --left_;
      push();
    } else {
      wants_more_ = true;
      wants_more_.notify_one();
    }
  }

  const Scene& scene_;
  GstElement* pipeline_;
  GstAppSrc* source_;
  std::int64_t pushed_ = 0;
  std::atomic<int> left_ = 0;
  std::atomic<bool> wants_more_ = false;
};

/// Duration of a piece of work, microseconds: wall-clock time, and CPU time of all threads, which
/// does not depend on other users of the machine.
struct Cost {
  double time;
  double processor;
};

Cost cost_of(const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  const auto processor = std::clock();
  const auto start = Clock::now();
  work();
  return {std::chrono::duration<double, std::micro>(Clock::now() - start).count(),
          1e6 * static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC};
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Runs both alternately; each call processes `frames` frames.
void by_turns(benchmark::State& state, const char* base_name, int frames,
              const std::function<void()>& ours, const std::function<void()>& base) {
  std::vector<double> ours_times;
  std::vector<double> base_times;
  std::vector<double> ratios;
  std::vector<double> processor_ratios;
  ours();
  base();
  for (auto _ : state) {
    const auto base_cost = cost_of(base);
    const auto ours_cost = cost_of(ours);
    base_times.push_back(base_cost.time / frames);
    ours_times.push_back(ours_cost.time / frames);
    ratios.push_back(ours_cost.time / base_cost.time);
    processor_ratios.push_back(ours_cost.processor / base_cost.processor);
  }
  state.counters["ours"] = median(ours_times);
  state.counters[base_name] = median(base_times);
  state.counters["ratio"] = median(ratios);
  state.counters["processor-ratio"] = median(processor_ratios);
}

void register_pipeline(const Scene& scene, const Method& method, const std::string& out,
                       int threads) {
  const auto name = scene.name + "/" + method.element + "/" + out.substr(0, out.find('/')) +
                    "/threads:" + std::to_string(threads);
  benchmark::RegisterBenchmark(
      name.c_str(),
      [&, out, threads](benchmark::State& state) {
        Pipeline pipeline(scene, method, out, threads);
        const LumaFormat format{scene.clip[0].width(), scene.clip[0].height(), 8};
        const auto simulator = method.make(format);
        const Settings settings{method.threshold, method.threshold, interpolated_frames, threads};
        std::int64_t pushed = 0;
        std::size_t events = 0;
        by_turns(
            state, "core", method.frames_per_turn, [&] { pipeline.run(method.frames_per_turn); },
            [&] {
              for (int i = 0; i < method.frames_per_turn; ++i, ++pushed) {
                const auto* made =
                    simulator->push(scene::luma(bench::back_and_forth(scene.clip, pushed)),
                                    pushed * scene::frame_time, settings);
                if (made != nullptr) events += made->size();
              }
            });
        state.counters["events"] = static_cast<double>(events) / static_cast<double>(pushed);
      })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

/// `count` random events of an interval, evenly distributed over pixels and steps.
EventBuckets random_events(int count, int width, int height) {
  std::minstd_rand random;
  constexpr int steps = interpolated_frames + 1;
  constexpr int rows_a_bucket = 16;
  EventBuckets events;
  events.reset(steps, (height + rows_a_bucket - 1) / rows_a_bucket);
  for (int i = 0; i < count; ++i) {
    const int step = 1 + i % steps;
    const int y = static_cast<int>(random() >> 4) % height;
    const int x = static_cast<int>(random() >> 4) % width;
    const auto polarity = random() % 64 < 32 ? Polarity::on : Polarity::off;
    events.bucket(step, y / rows_a_bucket)
        .push_back(Event::at(x, y, static_cast<std::uint32_t>(step), polarity));
  }
  for (const auto& bucket : events.buckets()) {
    auto& sorted = const_cast<EventBuckets::Bucket&>(bucket);
    std::ranges::sort(sorted, {}, [](const Event& e) { return std::pair(e.y(), e.x); });
  }
  return events;
}

constexpr int picture_width = 1280;
constexpr int picture_height = 720;

void copy_events(benchmark::State& state, int count) {
  const auto events = random_events(count, picture_width, picture_height);
  std::vector<Event> in(events.size());
  std::vector<Event> out(events.size());
  events.copy_to(in.data());
  by_turns(
      state, "memcpy", 1, [&] { events.copy_to(out.data()); },
      [&] { std::memcpy(out.data(), in.data(), in.size() * sizeof(Event)); });
}

void draw_events(benchmark::State& state, int count, const PixelLayout& layout) {
  const auto events = random_events(count, picture_width, picture_height);
  const std::ptrdiff_t stride = std::ptrdiff_t{picture_width} * layout.bytes;
  const auto size = static_cast<std::size_t>(stride) * picture_height;
  std::vector<std::byte> in(size);
  std::vector<std::byte> out(size);
  Accumulator accumulator(picture_width, picture_height);
  by_turns(
      state, "memcpy", 1,
      [&] {
        accumulator.add(events);
        accumulator.draw(palette(PaletteName::dark), layout, out.data(), stride);
      },
      [&] { std::memcpy(out.data(), in.data(), size); });
}

void register_all(const std::vector<Scene>& scenes, const std::vector<Method>& methods) {
  for (const auto& scene : scenes)
    for (const auto& method : methods)
      for (const char* out : {"application/x-event-camera", "video/x-raw,format=BGRx"})
        for (const int threads : {1, 2}) register_pipeline(scene, method, out, threads);

  for (const int count : {6'000, 60'000, 1'000'000}) {
    const auto events = "/events:" + std::to_string(count);
    benchmark::RegisterBenchmark(("copy" + events).c_str(), copy_events, count);
    for (const auto& [name, layout] :
         {std::pair("GRAY8", PixelLayout{}), std::pair("RGB", PixelLayout{.bytes = 3}),
          std::pair("BGRx", PixelLayout{.bytes = 4, .red = 2, .green = 1, .blue = 0})})
      benchmark::RegisterBenchmark((std::string("draw-") + name + events).c_str(), draw_events,
                                   count, layout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  gst_init(&argc, &argv);
  std::vector<Scene> scenes;
  scenes.push_back(drift());
  scenes.push_back({"ball-1280x720", bench::ball(12)});
  const std::vector<Method> methods = {
      {"eventsim-frame", make_frame_simulator, 20, 50},
      {"eventsim-dense",
       [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
         return make_dense_simulator(format);
       },
       3, 2},
  };
  register_all(scenes, methods);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
