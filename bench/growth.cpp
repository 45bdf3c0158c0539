// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"

namespace bench {
namespace {

/// A textured patch that moves over a static texture.
struct Setup {
  int width = 640;
  int height = 480;
  double share = 0.1;  ///< fraction of the frame that the patch covers
  int interpolated_frames = 10;
  double threshold_factor = 1;  ///< multiple of the method's threshold
};

constexpr int frame_count = 3;

/// Fraction of pixels that differ between two frames.
double changed_share(const Frame& a, const Frame& b) {
  int changed = 0;
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x)
      if (a.at(x, y) != b.at(x, y)) ++changed;
  return static_cast<double>(changed) / (a.width() * a.height());
}

void add(const std::string& axis, const std::string& value, const Setup& setup) {
  const auto clips = std::make_shared<std::vector<Clip>>();  // drawn on first use
  for (const auto& method : all_methods(setup.threshold_factor)) {
    if (axis == "n" && method.name.starts_with("dvs")) continue;  // it does not have n
    benchmark::RegisterBenchmark(
        ("growth/" + axis + "/" + method.name + "/" + value).c_str(),
        [=](benchmark::State& state) {
          if (clips->empty())
            clips->push_back(moving_patch(setup.width, setup.height, setup.share, frame_count));
          time_simulator(state, *clips, method.make,
                         {method.threshold, method.threshold, setup.interpolated_frames, 0});
          state.counters["pixels"] = setup.width * setup.height;
          state.counters["n"] = setup.interpolated_frames;
          state.counters["changed"] = changed_share(clips->front()[0], clips->front()[1]);
        })
        ->Unit(benchmark::kMillisecond)
        ->MinTime(0.03)  // for a plot
        ->UseRealTime();
  }
}

}  // namespace

void register_growth(bool few_frames) {
  if (few_frames) {
    add("pixels", "320x180", {.width = 320, .height = 180});
    return;
  }
  for (const int height : {180, 360, 720, 1080}) {
    const int width = height * 16 / 9;
    add("pixels", std::to_string(width) + "x" + std::to_string(height),
        {.width = width, .height = height});
  }
  for (const int n : {0, 5, 20, 40, 80}) add("n", std::to_string(n), {.interpolated_frames = n});
  for (const int percent : {0, 1, 10, 30, 100})
    add("changed", std::to_string(percent), {.share = percent / 100.0});
  for (const int percent : {33, 100, 200, 400})
    add("events", std::to_string(percent), {.share = 0.3, .threshold_factor = percent / 100.0});
}

}  // namespace bench
