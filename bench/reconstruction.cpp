// SPDX-License-Identifier: LGPL-2.1-or-later
// Reconstructs brightness on one core: million events per second, of a moving edge and of random
// pixels, and milliseconds per picture. Names are SENSOR/WHAT.
#include <benchmark/benchmark.h>

#include <random>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/reconstruct/reconstruction.hpp"

namespace {

using namespace eventcamera;

constexpr int count = 1 << 20;

/// Each column of the edge is 20 pixels wide, and advances every third event of a row.
std::vector<AbsoluteEvent> events_of(SensorSize size, bool is_edge) {
  std::minstd_rand random(1);
  const auto below = [&random](int n) { return std::uniform_int_distribution<>(0, n - 1)(random); };
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(
        is_edge ? (i / size.height / 3 + below(20)) % size.width : below(size.width),
        below(size.height), i, below(2) == 0 ? Polarity::off : Polarity::on));
  return events;
}

void add(benchmark::State& state, SensorSize size, bool is_edge) {
  const auto events = events_of(size, is_edge);
  Reconstruction reconstruction(size.width, size.height, {});
  for (auto _ : state)
    for (const auto& event : events) reconstruction.add(event);
  state.counters["Mev/s"] =
      benchmark::Counter(count / 1e6, benchmark::Counter::kIsIterationInvariantRate);
}

void finish_picture(benchmark::State& state, SensorSize size) {
  Reconstruction reconstruction(size.width, size.height, {});
  for (const auto& event : events_of(size, false)) reconstruction.add(event);
  for (auto _ : state) reconstruction.finish_picture();
}

}  // namespace

int main(int argc, char** argv) {
  for (const SensorSize size : {SensorSize{640, 480}, {1280, 720}}) {
    const auto name = std::to_string(size.width) + "x" + std::to_string(size.height);
    benchmark::RegisterBenchmark((name + "/edge").c_str(), add, size, true)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((name + "/random").c_str(), add, size, false)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((name + "/picture").c_str(), finish_picture, size)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
