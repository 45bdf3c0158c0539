// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cstring>

#include "bench/benchmarks.hpp"
#include "bench/playback.hpp"
#include "src/render/accumulator.hpp"

namespace bench {
namespace {

/// Events of an interval, in buckets from a simulator and as the content of a buffer.
struct Interval {
  StepBuckets buckets;
  std::vector<Event> buffer;
};

using Intervals = std::vector<Interval>;

/// The first interval of each clip, with dense interpolation, which gives the most events.
Intervals intervals_of(const Scene& scene) {
  const double threshold = dis_hq_method.threshold;
  const Settings settings{threshold, threshold, scene.interpolated_frames, 0};
  Intervals intervals;
  for (const auto& clip : scene.clips) {
    const LumaFormat format{clip[0].width(), clip[0].height(), 8};
    const auto simulator = dis_hq_method.make(format);
    const auto push = [&](const Frame& frame, Nanoseconds time) {
      return simulator->push({format, frame.row(0), frame.stride()}, time, settings);
    };
    push(clip[0], 0);
    auto& [buckets, buffer] = intervals.emplace_back();
    buckets = dynamic_cast<const StepBuckets&>(*push(clip[1], frame_time));
    buffer.resize(buckets.size());
    buckets.write_to(buffer.data(), simulator->threads());
  }
  return intervals;
}

/// Times visit(interval).
template <class Visit>
void time_intervals(benchmark::State& state, const Intervals& intervals, const Visit& visit) {
  double events = 0;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(intervals.size()))) {
    for (const auto& interval : intervals) {
      visit(interval);
      events += static_cast<double>(interval.buffer.size());
      benchmark::ClobberMemory();
    }
  }
  state.counters["events"] = events / static_cast<double>(state.iterations());
}

std::vector<Event> buffer_for(const Intervals& intervals) {
  std::size_t max_size = 1;
  for (const auto& interval : intervals) max_size = std::max(max_size, interval.buffer.size());
  return std::vector<Event>(max_size);
}

void time_copying_events(benchmark::State& state, const Intervals& intervals) {
  auto out = buffer_for(intervals);
  benchmark::DoNotOptimize(out.data());
  time_intervals(state, intervals, [&](const Interval& interval) {
    std::memcpy(out.data(), interval.buffer.data(), interval.buffer.size() * sizeof(Event));
  });
}

void time_writing_events(benchmark::State& state, const Intervals& intervals) {
  auto out = buffer_for(intervals);
  benchmark::DoNotOptimize(out.data());
  ThreadPool threads;
  time_intervals(state, intervals, [&](const Interval& interval) {
    if (interval.buckets.size() <= out.size()) interval.buckets.write_to(out.data(), threads);
  });
}

void time_copying_picture(benchmark::State& state, const Intervals& intervals, std::size_t bytes) {
  const std::vector<std::byte> in(bytes, std::byte{1});
  std::vector<std::byte> out(bytes);
  benchmark::DoNotOptimize(out.data());
  time_intervals(state, intervals,
                 [&](const Interval&) { std::memcpy(out.data(), in.data(), bytes); });
}

void time_drawing(benchmark::State& state, const Intervals& intervals, const Frame& frame,
                  const PixelLayout& layout) {
  const auto stride = static_cast<std::ptrdiff_t>(frame.width()) * layout.bytes;
  std::vector<std::byte> out(static_cast<std::size_t>(stride * frame.height()));
  benchmark::DoNotOptimize(out.data());
  Accumulator accumulator(frame.width(), frame.height());
  ThreadPool threads;
  time_intervals(state, intervals, [&](const Interval& interval) {
    accumulator.add(interval.buffer);
    accumulator.draw(palette(PaletteName::dark), layout, out.data(), stride, threads);
  });
}

}  // namespace

void register_events(const Scene& scene) {
  const auto intervals = std::make_shared<Intervals>();  // made on first use
  const auto add = [&](const std::string& name, const auto& body) {
    benchmark::RegisterBenchmark((scene.name + "/" + name + "/threads:1").c_str(),
                                 [&scene, intervals, body](benchmark::State& state) {
                                   if (intervals->empty()) *intervals = intervals_of(scene);
                                   body(state, *intervals);
                                 })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
  };
  add("events-to-buffer/memcpy", time_copying_events);
  add("events-to-buffer/ours", time_writing_events);
  const auto add_drawing = [&](const std::string& name, const PixelLayout& layout) {
    const auto& frame = scene.clips.front().front();
    const auto bytes = static_cast<std::size_t>(frame.width() * frame.height() * layout.bytes);
    add(name + "/memcpy", [bytes](benchmark::State& state, const Intervals& made) {
      time_copying_picture(state, made, bytes);
    });
    add(name + "/ours", [&frame, layout](benchmark::State& state, const Intervals& made) {
      time_drawing(state, made, frame, layout);
    });
  };
  add_drawing("buffer-to-grey-picture", {});
  add_drawing("buffer-to-rgbx-picture", {.bytes = 4});
}

}  // namespace bench
