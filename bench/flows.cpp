// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"

namespace bench {
namespace {

class OurFlow {
 public:
  OurFlow(FlowMethod method, const Frame& first, int threads) : flow_(make_dense_flow(method)) {
    threads_.set_threads(threads);
    flow_->push(first.view(), threads_);
  }
  void find(const Frame& /*last*/, const Frame& now) {
    flow_->push(now.view(), threads_);
    flow_->flow(threads_);
  }

 private:
  std::unique_ptr<DenseFlow> flow_;
  ThreadPool threads_;
};

class OpenCvFlow {
 public:
  OpenCvFlow(FlowMethod method, const Frame& first, int threads)
      : flow_(method, first.width(), first.height()), threads_(threads) {}
  void find(const Frame& last, const Frame& now) { flow_.find(last.view(), now.view(), threads_); }

 private:
  naive::OpenCvFlow flow_;
  int threads_;
};

/// Times the flow of whole frames, all frames of all clips equally often.
template <class Finder>
void time_flow(benchmark::State& state, const Scene& scene, FlowMethod method, int threads) {
  std::vector<std::unique_ptr<Finder>> finders;
  const int period = 2 * (static_cast<int>(scene.clips.front().size()) - 1);
  const auto play = [&](Finder& finder, const Clip& clip) {
    for (int i = 0; i < period; ++i)
      finder.find(back_and_forth(clip, i), back_and_forth(clip, i + 1));
  };
  for (const auto& clip : scene.clips) {
    finders.push_back(std::make_unique<Finder>(method, clip.front(), threads));
    play(*finders.back(), clip);  // warm-up
  }
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(finders.size()) * period))
    for (std::size_t i = 0; i < finders.size(); ++i) play(*finders[i], scene.clips[i]);
}

template <class Finder>
void add(const Scene& scene, const std::string& name, FlowMethod method, int threads) {
  benchmark::RegisterBenchmark(
      (scene.name + "/" + name + "/threads:" + std::to_string(threads)).c_str(),
      [&scene, method, threads](benchmark::State& state) {
        time_flow<Finder>(state, scene, method, threads);
      })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

}  // namespace

void register_flows(const Scene& scene) {
  const std::pair<const char*, FlowMethod> methods[] = {{"flow-dis-lq", FlowMethod::dis_lq},
                                                        {"flow-dis-hq", FlowMethod::dis_hq},
                                                        {"flow-farneback", FlowMethod::farneback}};
  for (const int threads : {2, 1}) {
    for (const auto& [name, method] : methods) {
      add<OpenCvFlow>(scene, name + std::string("/opencv"), method, threads);
      add<OurFlow>(scene, name + std::string("/ours"), method, threads);
    }
  }
}

}  // namespace bench
