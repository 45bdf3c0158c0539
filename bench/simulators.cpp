// SPDX-License-Identifier: LGPL-2.1-or-later
// How long a frame takes, with each method on three scenes: ours beside the plain formulation, in
// one process and one run. Names are SCENE/METHOD/FORMULATION/threads:N.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "bench/plain.hpp"
#include "src/simulate/dense.hpp"
#include "src/simulate/diff.hpp"
#include "src/simulate/frame.hpp"
#include "src/simulate/sparse.hpp"
#include "tests/core/scene.hpp"
#include "tests/pipelines/video_frames.hpp"

namespace {

using namespace eventcamera;

struct Scene {
  std::string name;
  std::vector<Plane<std::uint8_t>> frames;
  int interpolated_frames;
};

constexpr Nanoseconds frame_time = 40'000'000;

/// A ball of 40 pixels that flies over a still, textured picture.
Scene ball() {
  Scene scene{"ball-1280x720", {}, 10};
  for (int i = 0; i < 12; ++i) {
    auto picture = scene::texture<std::uint8_t>(1280, 720, 8, 0, 0);
    for (int y = -20; y < 20; ++y)
      for (int x = -20; x < 20; ++x)
        if (x * x + y * y < 400) picture.at(200 + 30 * i + x, 300 + 8 * i + y) = 240;
    scene.frames.push_back(std::move(picture));
  }
  return scene;
}

std::vector<Scene> scenes() {
  std::vector<Scene> scenes;
  const char* shared = std::getenv("SHARED_DATA");
  const auto add = [&](const std::string& name, const std::string& file, int first, int count,
                       int width, int height, int interpolated_frames) {
    const auto path = std::string(shared != nullptr ? shared : "") + "/video/" + file;
    if (!std::filesystem::exists(path)) {
      std::fprintf(stderr, "no %s: %s is left out\n", path.c_str(), name.c_str());
      return;
    }
    auto frames = video_frames::frames_of(path, first + count, width, height);
    frames.erase(frames.begin(), frames.begin() + first);
    scenes.push_back({name, std::move(frames), interpolated_frames});
  };
  add("driving-640x480", "driving-1280x720-25fps.mp4", 0, 12, 640, 480, 20);
  add("cars-1280x720", "cars-768x432-12fps.mp4", 80, 12, 1280, 720, 10);
  scenes.push_back(ball());
  return scenes;
}

/// The frames forwards and backwards for ever.
const Plane<std::uint8_t>& frame_of(const Scene& scene, int i) {
  const int last = static_cast<int>(scene.frames.size()) - 1;
  const int at = i % (2 * last);
  return scene.frames[static_cast<std::size_t>(at <= last ? at : 2 * last - at)];
}

LumaFormat format_of(const Scene& scene) {
  return {scene.frames.front().width(), scene.frames.front().height(), 8};
}

Settings settings_of(const Scene& scene, double threshold, int threads) {
  return {threshold, threshold, scene.interpolated_frames, threads};
}

/// A simulator, frame after frame.
void whole(benchmark::State& state, const Scene& scene, std::unique_ptr<Simulator> simulator,
           const Settings& settings) {
  int i = 0;
  const auto push = [&] {
    const auto* events = simulator->push(scene::luma(frame_of(scene, i)), i * frame_time, settings);
    ++i;
    return events;
  };
  for (int warm = 0; warm < 3; ++warm) push();
  double events = 0;
  for (auto _ : state) events += static_cast<double>(push()->size());
  state.counters["events"] = events / static_cast<double>(state.iterations());
}

/// One interval again and again, by a function of the last frame and this one.
template <class Body>
void interval(benchmark::State& state, int threads, const Body& body) {
  ThreadPool pool;
  pool.set_threads(threads);
  EventBuckets events;
  for (auto _ : state) body(pool, events);
  state.counters["events"] = static_cast<double>(events.size());
}

void register_all(const Scene& scene) {
  for (const int threads : {2, 1}) {
    const auto add = [&](const std::string& method, auto&& body) {
      benchmark::RegisterBenchmark(
          (scene.name + "/" + method + "/threads:" + std::to_string(threads)).c_str(), body)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    };
    const auto add_whole = [&](const std::string& method, double threshold, auto make) {
      add(method + "/ours", [&scene, threshold, threads, make](benchmark::State& state) {
        whole(state, scene, make(format_of(scene)), settings_of(scene, threshold, threads));
      });
    };
    const auto dense = [](FlowMethod flow) {
      return [flow](const LumaFormat& format) {
        auto simulator = make_dense_simulator(format);
        simulator->set_flow(flow);
        return simulator;
      };
    };
    const StepTimes steps(frame_time, scene.interpolated_frames + 1);
    const auto& last = scene.frames[4];
    const auto& now = scene.frames[5];

    add("memcpy/frame", [&last](benchmark::State& state) {
      auto copy = last;
      for (auto _ : state) {
        copy.assign(last.view());
        benchmark::DoNotOptimize(copy.row(0));
      }
    });
    add("frame/plain",
        [&last, &now, steps, threads, thresholds = Thresholds{20, 20}](benchmark::State& state) {
          auto kept = last;  // the simulator keeps the frame, too
          interval(state, threads, [&](ThreadPool& pool, EventBuckets& events) {
            plain::frame(last, now, steps, thresholds, pool, events);
            kept.assign(now.view());
          });
        });
    add_whole("frame", 20, make_frame_simulator);

    const Thresholds thresholds{3, 3};
    const auto with_flow = [&last, &now](const auto& body) {
      const auto finder = make_dense_flow(FlowMethod::dis_hq, now.width(), now.height());
      ThreadPool pool;
      body(finder->find(last.view(), now.view(), pool));
    };
    add("dense-after-flow/plain", [=, &last, &now](benchmark::State& state) {
      with_flow([&](const PlaneView<Flow>& flow) {
        interval(state, threads, [&](ThreadPool& pool, EventBuckets& events) {
          plain::dense(last, now, flow, steps, thresholds, pool, events);
        });
      });
    });
    add("dense-after-flow/ours", [=, &last, &now](benchmark::State& state) {
      with_flow([&](const PlaneView<Flow>& flow) {
        const Path<std::uint8_t> path{{last.view(), now.view(), steps.count()},
                                      flow,
                                      Interpolation::forward,
                                      steps,
                                      thresholds};
        PathWalker walker;
        interval(state, threads,
                 [&](ThreadPool& pool, EventBuckets& events) { walker.fire(path, pool, events); });
      });
    });
    add_whole("dense-dis-lq", 3, dense(FlowMethod::dis_lq));
    add_whole("dense-dis-hq", 3, dense(FlowMethod::dis_hq));
    add_whole("dense-farneback", 3, dense(FlowMethod::farneback));
    add_whole("sparse", 6, make_sparse_simulator);
    add_whole("diff", 19, make_diff_simulator);
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  const auto all = scenes();
  for (const auto& scene : all) register_all(scene);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
