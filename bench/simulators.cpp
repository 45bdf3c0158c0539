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
    naive::OpenCvFlow finder(FlowMethod::dis_hq, width, height);
    for (std::size_t i = 1; i < clip.size(); ++i) {
      const auto flow = finder.find(clip[i - 1].view(), clip[i].view(), 1);
      pairs.push_back({&clip[i - 1],
                       &clip[i],
                       {flow.data, flow.data + static_cast<std::ptrdiff_t>(width) * height}});
    }
  }
  return pairs;
}

/// Times the steps after the flow: fire(pair, threads, events).
template <class Fire>
void time_pairs(benchmark::State& state, const Pairs& pairs, int threads, const Fire& fire) {
  ThreadPool pool;
  pool.set_threads(threads);
  StepBuckets events;
  EventMemory memory;
  fire(pairs.front(), pool, events);
  double sum = 0;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(pairs.size()))) {
    for (const auto& pair : pairs) {
      fire(pair, pool, events);
      sum += static_cast<double>(memory.write(events, pool));
    }
  }
  state.counters["events"] = sum / static_cast<double>(state.iterations());
}

void time_naive_after_flow(benchmark::State& state, const Pairs& pairs, const StepTimes& steps,
                           const Thresholds& thresholds, int threads) {
  const auto& frame = *pairs.front().now;
  naive::DenseInterpolation interpolation(frame.width(), frame.height());
  time_pairs(state, pairs, threads, [&](const Pair& pair, ThreadPool& pool, StepBuckets& events) {
    interpolation.fire(pair.last->view(), pair.now->view(), pair.flow_view(), steps, thresholds,
                       pool, events);
  });
}

void time_our_after_flow(benchmark::State& state, const Pairs& pairs, const StepTimes& steps,
                         const Thresholds& thresholds, int threads) {
  InterpolationKernel kernel;
  time_pairs(state, pairs, threads, [&](const Pair& pair, ThreadPool& pool, StepBuckets& events) {
    kernel.fire(
        InterpolatedInterval<std::uint8_t>{{pair.last->view(), pair.now->view(), steps.count()},
                                           pair.flow_view(),
                                           Interpolation::forward,
                                           steps,
                                           thresholds},
        pool, events);
  });
}

}  // namespace

void register_simulators(const Scene& scene) {
  const auto pairs = std::make_shared<Pairs>();  // made on first use
  for (const int threads : {2, 1}) {
    const auto add = [&](const std::string& name, const auto& body) {
      benchmark::RegisterBenchmark(
          (scene.name + "/" + name + "/threads:" + std::to_string(threads)).c_str(), body)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    };
    const auto add_method = [&](const Method& method) {
      const Settings settings{method.threshold, method.threshold, scene.interpolated_frames,
                              threads};
      const auto add_formulation = [&](const std::string& name, const MakeSimulator& make) {
        add(method.name + "/" + name, [&scene, make, settings](benchmark::State& state) {
          time_simulator(state, scene.clips, make, settings);
        });
      };
      if (method.naive) add_formulation("naive", method.naive);
      add_formulation("ours", method.ours);
    };
    const auto add_after_flow = [&](const std::string& name, auto time) {
      add("dense-after-flow/" + name, [&scene, pairs, threads, time](benchmark::State& state) {
        if (pairs->empty()) *pairs = pairs_of(scene);
        time(state, *pairs, StepTimes(frame_time, scene.interpolated_frames + 1), Thresholds{3, 3},
             threads);
      });
    };

    for (const auto& method : all_methods()) add_method(method);
    add_after_flow("naive", time_naive_after_flow);
    add_after_flow("ours", time_our_after_flow);
  }
}

}  // namespace bench
