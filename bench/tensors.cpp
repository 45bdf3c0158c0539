// SPDX-License-Identifier: LGPL-2.1-or-later
// Cuts events into windows and makes tensors of them on one core: million events per second, and
// the time as a multiple of that of a memcpy of the events in the same run. Names are
// SENSOR/REPRESENTATION; windows of 33 ms have 330,000 events at random pixels, the worst case for
// caches.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/tensor/event_tensor.hpp"
#include "src/tensor/window_queue.hpp"

namespace {

using namespace eventcamera;

constexpr Nanoseconds window = 33'000'000;
constexpr Nanoseconds interval = 10'000'000;  ///< of a buffer
constexpr int intervals = 40;
constexpr int events_per_microsecond = 10;

using Buffer = std::vector<Event>;

std::vector<Buffer> noise(SensorSize size) {
  std::mt19937 random(1);
  std::vector<Buffer> buffers(intervals);
  for (auto& buffer : buffers)
    for (std::uint32_t i = 0; i < interval / 1000 * events_per_microsecond; ++i)
      buffer.push_back(Event::at(static_cast<int>(random() % static_cast<unsigned>(size.width)),
                                 static_cast<int>(random() % static_cast<unsigned>(size.height)),
                                 i / events_per_microsecond,
                                 random() % 2 == 0 ? Polarity::off : Polarity::on));
  return buffers;
}

void make_tensors(const std::vector<Buffer>& buffers, SensorSize size,
                  const TensorSettings& settings, std::vector<std::byte>& out) {
  EventTensor tensor(size.width, size.height, settings);
  WindowQueue queue(size.width, size.height, {.duration = window});
  out.resize(tensor.bytes());
  Nanoseconds start = 0;
  for (const auto& buffer : buffers) {
    queue.add(buffer, start / 1000, start, start + interval);
    while (const auto next = queue.next()) tensor.write(next->events, next->end / 1000, out.data());
    start += interval;
    benchmark::ClobberMemory();
  }
}

void register_all(const std::string& name, SensorSize size) {
  const auto add = [&](const std::string& what, const TensorSettings& settings) {
    benchmark::RegisterBenchmark((name + "/" + what).c_str(), [=](benchmark::State& state) {
      const auto buffers = noise(size);
      std::vector<std::byte> out;
      std::vector<Event> copy(buffers[0].size());
      double copying = 0;
      double events = 0;
      for (auto _ : state) {
        make_tensors(buffers, size, settings, out);
        const auto start = std::chrono::steady_clock::now();
        state.PauseTiming();
        for (const auto& buffer : buffers) {
          std::memcpy(copy.data(), buffer.data(), buffer.size() * sizeof buffer[0]);
          benchmark::ClobberMemory();
          events += static_cast<double>(buffer.size());
        }
        copying += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        state.ResumeTiming();
      }
      state.counters["Mev/s"] = benchmark::Counter(events / 1e6, benchmark::Counter::kIsRate);
      state.counters["memcpy-Mev/s"] = events / 1e6 / copying;
    })->Unit(benchmark::kMillisecond);
  };
  add("histogram", {.representation = Representation::histogram});
  add("voxel-grid", {});
  add("event-frame", {.representation = Representation::event_frame});
  add("time-surface", {.representation = Representation::time_surface});
  add("voxel-grid-mean-std", {.normalization = Normalization::mean_std});
  add("voxel-grid-float16", {.type = ElementType::float16});
  add("histogram-uint8", {.representation = Representation::histogram, .type = ElementType::uint8});
}

}  // namespace

int main(int argc, char** argv) {
  register_all("346x260", {346, 260});
  register_all("640x480", {640, 480});
  register_all("1280x720", {1280, 720});
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
