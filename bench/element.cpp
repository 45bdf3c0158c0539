// SPDX-License-Identifier: LGPL-2.1-or-later
// Overhead of GStreamer per frame: an element compared to its core, which writes the events to
// memory or draws them as the element does; and events written and drawn compared to a memcpy of
// the same bytes. Both sides of a comparison alternate in one run. Counters are medians:
// microseconds per frame, and ratios of wall-clock and CPU time.
//   meson devenv -C build-bench bench/element_bench
#include <benchmark/benchmark.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <utility>
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

/// An element between two bare pads, fed from memory by the calling thread, so that nothing but the
/// element is timed.
class FedElement {
 public:
  FedElement(const Scene& scene, const Method& method, const std::string& out, int threads) {
    const std::string launch = method.element + " n-threads=" + std::to_string(threads) +
                               " positive-threshold=" + std::to_string(method.threshold) +
                               " negative-threshold=" + std::to_string(method.threshold);
    GError* error = nullptr;
    element_ = gst_parse_launch(launch.c_str(), &error);
    if (error != nullptr) {
      std::fprintf(stderr, "%s: %s\n", launch.c_str(), error->message);
      std::exit(1);
    }
    gst_object_ref_sink(element_);
    source_ = pad_of(GST_PAD_SRC, "ANY", "sink");
    sink_ = pad_of(GST_PAD_SINK, out.c_str(), "src");
    gst_pad_set_chain_function(sink_, [](GstPad*, GstObject*, GstBuffer* buffer) {
      gst_buffer_unref(buffer);
      return GST_FLOW_OK;
    });
    gst_pad_set_active(sink_, TRUE);
    gst_element_set_state(element_, GST_STATE_PLAYING);
    gst_pad_set_active(source_, TRUE);

    const auto& first = scene.clip.front();
    gst_pad_push_event(source_, gst_event_new_stream_start("benchmark"));
    GstCaps* caps = gst_caps_new_simple(
        "video/x-raw", "format", G_TYPE_STRING, "GRAY8", "width", G_TYPE_INT, first.width(),
        "height", G_TYPE_INT, first.height(), "framerate", GST_TYPE_FRACTION, 25, 1, nullptr);
    gst_pad_push_event(source_, gst_event_new_caps(caps));
    gst_caps_unref(caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_pad_push_event(source_, gst_event_new_segment(&segment));
    for (const auto& frame : scene.clip) frames_.push_back(wrapped(frame));
  }
  ~FedElement() {
    gst_pad_set_active(source_, FALSE);
    gst_element_set_state(element_, GST_STATE_NULL);
    gst_pad_set_active(sink_, FALSE);
    for (GstBuffer* frame : frames_) gst_buffer_unref(frame);
    gst_object_unref(source_);
    gst_object_unref(sink_);
    gst_object_unref(element_);
  }
  FedElement(const FedElement&) = delete;
  FedElement& operator=(const FedElement&) = delete;

  void push(int frames) {
    for (int i = 0; i < frames; ++i, ++pushed_) {
      GstBuffer* frame = bench::back_and_forth(frames_, pushed_);
      GST_BUFFER_PTS(frame) = static_cast<GstClockTime>(pushed_ * scene::frame_time);
      if (gst_pad_push(source_, gst_buffer_ref(frame)) != GST_FLOW_OK) std::exit(1);
    }
  }

 private:
  /// Makes a pad that is linked to one of the element.
  GstPad* pad_of(GstPadDirection direction, const char* caps, const char* peer_name) {
    GstCaps* accepted = gst_caps_from_string(caps);
    GstPadTemplate* pad_template =
        gst_pad_template_new("bench", direction, GST_PAD_ALWAYS, accepted);
    gst_caps_unref(accepted);
    auto* pad = GST_PAD(gst_object_ref_sink(gst_pad_new_from_template(pad_template, nullptr)));
    gst_object_unref(pad_template);
    GstPad* peer = gst_element_get_static_pad(element_, peer_name);
    const auto linked =
        direction == GST_PAD_SRC ? gst_pad_link(pad, peer) : gst_pad_link(peer, pad);
    gst_object_unref(peer);
    if (linked != GST_PAD_LINK_OK) std::exit(1);
    return pad;
  }

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

  GstElement* element_;
  GstPad* source_;
  GstPad* sink_;
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

void register_element(const Scene& scene, const Method& method, const std::string& out,
                      int threads) {
  const auto name = scene.name + "/" + method.element + "/" + out.substr(0, out.find('/')) +
                    "/threads:" + std::to_string(threads);
  benchmark::RegisterBenchmark(name.c_str(),
                               [&, out, threads](benchmark::State& state) {
                                 FedElement element(scene, method, out, threads);
                                 Core core(scene, method, out.starts_with("video"), threads);
                                 by_turns(
                                     state, "core", method.frames_per_turn,
                                     [&] { element.push(method.frames_per_turn); },
                                     [&] { core.push(method.frames_per_turn); });
                                 state.counters["events"] = core.events_per_frame();
                               })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

/// About `count` random events of an interval, evenly distributed over pixels and steps.
StepBuckets random_events(int count, int width, int height) {
  std::minstd_rand random;
  constexpr int steps = interpolated_frames + 1;
  std::bernoulli_distribution fires(static_cast<double>(count) / (steps * width * height));
  StepBuckets events;
  events.reset(steps, band_count(height));
  for (int step = 1; step <= steps; ++step) {
    for (int y = 0; y < height; ++y) {
      auto& pixels = events.pixels(step, y / rows_per_band);
      if (y % rows_per_band == 0) pixels.begin(static_cast<std::uint32_t>(step));
      for (int x = 0; x < width; x += 64) {
        std::uint64_t fired = 0;
        for (int i = 0; i < std::min(64, width - x); ++i)
          if (fires(random)) fired |= std::uint64_t{1} << i;
        pixels.add(x, y, fired, random());
      }
    }
  }
  return events;
}

constexpr int picture_width = 1280;
constexpr int picture_height = 720;

void write_events(benchmark::State& state, int count) {
  const auto events = random_events(count, picture_width, picture_height);
  std::vector<Event> in(events.size());
  std::vector<Event> out(events.size());
  ThreadPool threads;
  events.write_to(in.data(), threads);
  by_turns(
      state, "memcpy", 1, [&] { events.write_to(out.data(), threads); },
      [&] { std::memcpy(out.data(), in.data(), in.size() * sizeof(Event)); });
}

void draw_events(benchmark::State& state, int count, const PixelLayout& layout) {
  const auto events = random_events(count, picture_width, picture_height);
  const std::ptrdiff_t stride = std::ptrdiff_t{picture_width} * layout.bytes;
  const auto size = static_cast<std::size_t>(stride) * picture_height;
  std::vector<std::byte> in(size);
  std::vector<std::byte> out(size);
  Accumulator accumulator(picture_width, picture_height);
  ThreadPool threads;
  by_turns(
      state, "memcpy", 1,
      [&] {
        accumulator.add(events, threads);
        accumulator.draw(palette(PaletteName::dark), layout, out.data(), stride, threads);
      },
      [&] { std::memcpy(out.data(), in.data(), size); });
}

void register_all(const std::vector<Scene>& scenes, const std::vector<Method>& methods) {
  for (const auto& scene : scenes)
    for (const auto& method : methods)
      for (const char* out : {"application/x-event-camera", "video/x-raw,format=BGRx"})
        for (const int threads : {1, 2}) register_element(scene, method, out, threads);

  for (const int count : {6'000, 60'000, 1'000'000}) {
    const auto events = "/events:" + std::to_string(count);
    benchmark::RegisterBenchmark(("write" + events).c_str(), write_events, count);
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
      {"eventsim-dvs",
       [](const LumaFormat& format) -> std::unique_ptr<Simulator> {
         return make_dvs_simulator(format);
       },
       DvsSettings().positive_threshold, 20},
  };
  register_all(scenes, methods);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
