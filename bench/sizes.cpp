// SPDX-License-Identifier: LGPL-2.1-or-later
#include <map>
#include <optional>

#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"

namespace bench {
namespace {

struct Size {
  int width;
  int height;
};

std::string name_of(const Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

void register_sizes(bool few_frames) {
  std::vector<Size> sizes{{640, 480}, {1280, 720}, {1920, 1080}, {2560, 1440}, {3840, 2160}};
  if (few_frames) sizes.resize(2);
  const auto scenes = std::make_shared<std::map<std::string, std::optional<Scene>>>();
  auto methods = all_methods();
  methods.push_back(opencv_dis_method);
  for (const auto& method : methods) {
    const auto too_slow_at = std::make_shared<std::string>();  // a smaller size
    for (const auto& size : sizes) {
      const auto name = name_of(size);
      benchmark::RegisterBenchmark(
          ("sizes/" + method.name + "/" + name).c_str(),
          [=](benchmark::State& state) {
            if (!too_slow_at->empty() && *too_slow_at != name && size.height > 1080) {
              const auto note = "less than 30 frames a second at " + *too_slow_at;
              return state.SkipWithError(note.c_str());
            }
            auto& scene = (*scenes)[name];  // read on first use
            if (!scene) scene = driving(size.width, size.height, few_frames);
            if (!scene) return state.SkipWithError("no video");
            const double seconds =
                time_simulator(state, scene->clips, method.make,
                               {method.threshold, method.threshold, scene->interpolated_frames, 2});
            if (seconds > 1.0 / 30) *too_slow_at = name;
          })
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    }
  }
}

}  // namespace bench
