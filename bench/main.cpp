// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs all benchmarks. Accepts the options of Google Benchmark, and --few-frames for the shortest
// possible run.
#include <benchmark/benchmark.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cstring>

#include "bench/benchmarks.hpp"

int main(int argc, char** argv) {
  const auto is_few_frames = [](const char* argument) {
    return std::strcmp(argument, "--few-frames") == 0;
  };
  char** end = std::remove_if(argv + 1, argv + argc, is_few_frames);
  const bool few_frames = end != argv + argc;
  argc = static_cast<int>(end - argv);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;

  const auto targets = hwy::SupportedTargets();
  benchmark::AddCustomContext("vectors", hwy::TargetName(targets & -targets));  // the best target
  const auto scenes = bench::scenes(few_frames);
  for (const auto& scene : scenes) {
    bench::register_simulators(scene);
    bench::register_flows(scene);
    bench::register_events(scene);
  }
  bench::register_sizes(few_frames);
  bench::register_growth(few_frames);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
