// SPDX-License-Identifier: LGPL-2.1-or-later
// Overhead of GStreamer per frame: an element compared to its core, which writes the events to
// memory or draws them as the element does. They alternate in one run. Counters are medians:
// microseconds per frame, and ratios of wall-clock and CPU time.
//   meson devenv -C build-bench bench/element_bench
#include <benchmark/benchmark.h>
#include <gst/check/gstharness.h>
#include <gst/video/video.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/scenes.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "src/render/accumulator.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/simulate/scene.hpp"

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

/// An element fed from memory by the calling thread, so that nothing but the element is timed.
class FedElement {
 public:
  FedElement(const Scene& scene, const Method& method, const std::string& out, int threads) {
    const std::string launch = method.element + " n-threads=" + std::to_string(threads) +
                               " positive-threshold=" + std::to_string(method.threshold) +
                               " negative-threshold=" + std::to_string(method.threshold);
    harness_ = gst_harness_new_parse(launch.c_str());
    gst_harness_set_drop_buffers(harness_, TRUE);
    const auto& first = scene.clip.front();
    gst_harness_set_caps_str(
        harness_,
        ("video/x-raw,format=GRAY8,framerate=25/1,width=" + std::to_string(first.width()) +
         ",height=" + std::to_string(first.height()))
            .c_str(),
        out.c_str());
    for (const auto& frame : scene.clip) frames_.push_back(wrapped(frame));
  }
  ~FedElement() {
    for (GstBuffer* frame : frames_) gst_buffer_unref(frame);
    gst_harness_teardown(harness_);
  }
  FedElement(const FedElement&) = delete;
  FedElement& operator=(const FedElement&) = delete;

  void push(int frames) {
    for (int i = 0; i < frames; ++i, ++pushed_) {
      GstBuffer* frame = bench::back_and_forth(frames_, pushed_);
      GST_BUFFER_PTS(frame) = static_cast<GstClockTime>(pushed_ * scene::frame_time);
      if (gst_harness_push(harness_, gst_buffer_ref(frame)) != GST_FLOW_OK) std::exit(1);
    }
  }

 private:
  static GstBuffer* wrapped(const bench::Frame& frame) {
    gsize offsets[GST_VIDEO_MAX_PLANES] = {};
    gint strides[GST_VIDEO_MAX_PLANES] = {static_cast<gint>(frame.stride())};
    const auto size = static_cast<gsize>(frame.stride()) * static_cast<gsize>(frame.height());
    GstBuffer* buffer = gst_buffer_new_wrapped_full(GST_MEMORY_FLAG_READONLY,
                                                    const_cast<std::uint8_t*>(frame.row(0)), size,
                                                    0, size, nullptr, nullptr);
    gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8,
                                   static_cast<guint>(frame.width()),
                                   static_cast<guint>(frame.height()), 1, offsets, strides);
    return buffer;
  }

  GstHarness* harness_;
  std::vector<GstBuffer*> frames_;
  std::int64_t pushed_ = 0;
};

/// The core of an element: frames to events in memory, or to a picture.
class Core {
 public:
  Core(const Scene& scene, const Method& method, bool draws, int threads)
      : scene_(scene),
        simulator_(method.make({scene.clip[0].width(), scene.clip[0].height(), 8})),
        settings_{method.threshold, method.threshold, interpolated_frames, threads},
        accumulator_(scene.clip[0].width(), scene.clip[0].height()),
        picture_(draws ? static_cast<std::size_t>(stride()) *
                             static_cast<std::size_t>(scene.clip[0].height())
                       : 0) {}

  void push(int frames) {
    for (int i = 0; i < frames; ++i, ++pushed_) {
      const auto* made = simulator_->push(scene::luma(bench::back_and_forth(scene_.clip, pushed_)),
                                          pushed_ * scene::frame_time, settings_);
      if (made == nullptr) continue;
      events_ += made->size();
      if (picture_.empty())
        write(*made);
      else
        draw(*made);
    }
  }

  double events_per_frame() const {
    return static_cast<double>(events_) / static_cast<double>(pushed_);
  }

 private:
  void write(const EventBuckets& events) {
    if (memory_.size() < events.size()) memory_.resize(events.size());
    events.write_to(memory_.data(), simulator_->threads());
  }
  void draw(const EventBuckets& events) {
    constexpr PixelLayout bgrx{.bytes = 4, .red = 2, .green = 1, .blue = 0};
    accumulator_.add(events, simulator_->threads());
    accumulator_.draw(palette(PaletteName::dark), bgrx, picture_.data(), stride(),
                      simulator_->threads());
  }
  std::ptrdiff_t stride() const { return std::ptrdiff_t{4} * scene_.clip[0].width(); }

  const Scene& scene_;
  std::unique_ptr<Simulator> simulator_;
  Settings settings_;
  std::vector<Event> memory_;
  Accumulator accumulator_;
  std::vector<std::byte> picture_;  ///< empty if the events are written
  std::int64_t pushed_ = 0;
  std::size_t events_ = 0;
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
void by_turns(benchmark::State& state, int frames, const std::function<void()>& ours,
              const std::function<void()>& base) {
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
  state.counters["core"] = median(base_times);
  state.counters["ratio"] = median(ratios);
  state.counters["processor-ratio"] = median(processor_ratios);
}

void register_element(const Scene& scene, const Method& method, const std::string& out,
                      int threads) {
  const auto name = scene.name + "/" + method.element + "/" + out.substr(0, out.find('/')) +
                    "/threads:" + std::to_string(threads);
  benchmark::RegisterBenchmark(name.c_str(),
                               [&, out, threads](benchmark::State& state) {
                                 FedElement element(scene, method, out, threads);
                                 Core core(scene, method, out.starts_with("video"), threads);
                                 by_turns(
                                     state, method.frames_per_turn,
                                     [&] { element.push(method.frames_per_turn); },
                                     [&] { core.push(method.frames_per_turn); });
                                 state.counters["events"] = core.events_per_frame();
                               })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
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
      {"eventsim-dvs",
       [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
         return make_dvs_simulator(format);
       },
       DvsSettings().positive_threshold, 20},
  };
  for (const auto& scene : scenes)
    for (const auto& method : methods)
      for (const char* out : {"application/x-event-camera", "video/x-raw,format=BGRx"})
        for (const int threads : {1, 2}) register_element(scene, method, out, threads);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
