// SPDX-License-Identifier: LGPL-2.1-or-later
// Cuts events into windows and makes tensors of them on one core: million events per second, and
// the time as a multiple of that of a memcpy of the events in the same run. Names are
// SENSOR/REPRESENTATION; windows of 33 ms have 330,000 events at random pixels, the worst case for
// caches.
#include <benchmark/benchmark.h>

#include <span>
#include <string>
#include <vector>

#include "bench/codec_timing.hpp"
#include "src/core/sensor_size.hpp"
#include "src/tensor/event_tensor.hpp"
#include "src/tensor/window_queue.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;

constexpr Nanoseconds window = 33'000'000;
constexpr Nanoseconds interval = 10'000'000;  ///< of a buffer
constexpr int intervals = 40;
constexpr int events_per_microsecond = 10;
constexpr std::size_t events_per_interval = interval / 1000 * events_per_microsecond;

std::vector<Event> noise(SensorSize size) {
  recordings::Random random(1);
  std::vector<Event> events;
  for (int buffer = 0; buffer < intervals; ++buffer)
    for (std::size_t i = 0; i < events_per_interval; ++i)
      events.push_back(Event::at(recordings::below(random, size.width),
                                 recordings::below(random, size.height),
                                 static_cast<std::uint32_t>(i / events_per_microsecond),
                                 recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
  return events;
}

void make_tensors(const std::vector<Event>& events, SensorSize size, const TensorSettings& settings,
                  std::vector<std::byte>& out) {
  EventTensor tensor(size.width, size.height, settings);
  WindowQueue queue(size.width, size.height, {.duration = window});
  out.resize(tensor.bytes());
  for (std::size_t i = 0; i < intervals; ++i) {
    const auto start = static_cast<Nanoseconds>(i) * interval;
    queue.add(std::span(events).subspan(i * events_per_interval, events_per_interval), start / 1000,
              start, start + interval);
    while (const auto next = queue.next()) tensor.write(next->events, next->end / 1000, out.data());
    benchmark::ClobberMemory();
  }
}

void register_all(const std::string& name, SensorSize size) {
  const auto add = [&](const std::string& what, const TensorSettings& settings) {
    benchmark::RegisterBenchmark((name + "/" + what).c_str(), [=](benchmark::State& state) {
      const auto events = noise(size);
      std::vector<std::byte> out;
      bench::measure(state, events, [&] { make_tensors(events, size, settings, out); });
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
