// SPDX-License-Identifier: LGPL-2.1-or-later
#include <opencv2/video/tracking.hpp>

#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"
#include "src/flow/dis/dis.hpp"
#include "src/flow/opencv.hpp"

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

/// OpenCV's implementation, with the parameters of ours.
class OpenCvFlow {
 public:
  OpenCvFlow(FlowMethod method, const Frame& first, int threads)
      : farneback_(method == FlowMethod::farneback) {
    cv::setNumThreads(threads);
    const auto& quality = method == FlowMethod::dis_hq ? DisFlow::high : DisFlow::low;
    dis_->setPatchSize(quality.patch);
    dis_->setPatchStride(quality.stride);
    dis_->setGradientDescentIterations(quality.iterations);
    dis_->setFinestScale(quality.finest_scale(first.width(), first.height()));
    dis_->setUseSpatialPropagation(false);
  }
  void find(const Frame& last, const Frame& now) {
    if (farneback_) {
      cv::calcOpticalFlowFarneback(opencv_image(last.view()), opencv_image(now.view()), flow_, 0.5,
                                   3, 15, 3, 5, 1.2, 0);
      return;
    }
    flow_.release();  // otherwise the search would start from the last flow
    // OpenCV's DIS requires contiguous rows.
    opencv_image(last.view()).copyTo(last_);
    opencv_image(now.view()).copyTo(now_);
    dis_->calc(last_, now_, flow_);
  }

 private:
  bool farneback_;
  cv::Ptr<cv::DISOpticalFlow> dis_ = cv::DISOpticalFlow::create();
  cv::Mat last_;
  cv::Mat now_;
  cv::Mat flow_;
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
