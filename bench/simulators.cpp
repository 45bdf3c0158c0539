// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"
#include "src/simulate/interpolation.hpp"

namespace bench {
namespace {

/// Two frames and the flow between them.
struct Pair {
  const Frame* last;
  const Frame* now;
  std::vector<Flow> flow;

  ImageView<Flow> flow_view() const {
    return {flow.data(), now->width() * static_cast<std::ptrdiff_t>(sizeof(Flow)), now->width(),
            now->height()};
  }
};

using Pairs = std::vector<Pair>;

Pairs pairs_of(const Scene& scene) {
  Pairs pairs;
  for (const auto& clip : scene.clips) {
    const int width = clip.front().width();
    const int height = clip.front().height();
    const auto flow = make_dense_flow(FlowMethod::dis_hq);
    ThreadPool threads;
    flow->push(clip.front().view(), threads);
    for (std::size_t i = 1; i < clip.size(); ++i) {
      flow->push(clip[i].view(), threads);
      const auto* found = flow->flow(threads).data;
      pairs.push_back(
          {&clip[i - 1], &clip[i], {found, found + static_cast<std::ptrdiff_t>(width) * height}});
    }
  }
  return pairs;
}

/// Times the steps after the flow.
void time_pairs(benchmark::State& state, const Pairs& pairs, const StepTimes& steps, int threads) {
  ThreadPool pool;
  pool.set_threads(threads);
  InterpolationKernel kernel;
  StepBuckets events;
  EventMemory memory;
  const auto fire = [&](const Pair& pair) {
    kernel.fire(
        InterpolatedInterval<std::uint8_t>{{pair.last->view(), pair.now->view(), steps.count()},
                                           pair.flow_view(),
                                           Interpolation::forward,
                                           steps,
                                           {3, 3}},
        pool, events);
  };
  fire(pairs.front());
  double sum = 0;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(pairs.size()))) {
    for (const auto& pair : pairs) {
      fire(pair);
      sum += static_cast<double>(memory.write(events, pool));
    }
  }
  state.counters["events"] = sum / static_cast<double>(state.iterations());
}

}  // namespace

void register_simulators(const Scene& scene) {
  const auto pairs = std::make_shared<Pairs>();  // made on first use
  for (const int threads : {2, 1}) {
    const auto add = [&](const std::string& name, const auto& body) {
      benchmark::RegisterBenchmark(
          (scene.name + "/" + name + "/ours/threads:" + std::to_string(threads)).c_str(), body)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    };
    for (const auto& method : all_methods()) {
      const Settings settings{method.threshold, method.threshold, scene.interpolated_frames,
                              threads};
      add(method.name, [&scene, make = method.make, settings](benchmark::State& state) {
        time_simulator(state, scene.clips, make, settings);
      });
    }
    add("dense-after-flow", [&scene, pairs, threads](benchmark::State& state) {
      if (pairs->empty()) *pairs = pairs_of(scene);
      time_pairs(state, *pairs, StepTimes(frame_time, scene.interpolated_frames + 1), threads);
    });
  }
}

}  // namespace bench
