// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <memory>

#include "bench/methods.hpp"
#include "bench/scenes.hpp"

namespace bench {

/// Memory that grows to the events of an interval.
class EventMemory {
 public:
  /// Writes the events; returns their number.
  std::size_t write(const EventBuckets& events, ThreadPool& threads) {
    if (memory_.size() < events.size()) memory_.resize(events.size());
    events.write_to(memory_.data(), threads);
    return events.size();
  }

 private:
  std::vector<Event> memory_;
};

/// A simulator fed with a clip, forwards and backwards, forever.
class Playback {
 public:
  Playback(const Clip& clip, std::unique_ptr<Simulator> simulator, const Settings& settings)
      : clip_(clip), simulator_(std::move(simulator)), settings_(settings) {
    // Warm-up: the first frame starts the simulator, and memory grows in the first intervals.
    while (pushed_ < period()) push();
  }

  /// Number of frames, forwards and backwards.
  int period() const { return 2 * (static_cast<int>(clip_.size()) - 1); }

  /// Simulates the next interval and writes its events to memory; returns their number.
  std::size_t push() {
    const auto& frame = back_and_forth(clip_, pushed_);
    const auto* events =
        simulator_->push({{frame.width(), frame.height(), 8}, frame.row(0), frame.stride()},
                         pushed_++ * frame_time, settings_);
    return events == nullptr ? 0 : events_.write(*events, simulator_->threads());
  }

 private:
  const Clip& clip_;
  std::unique_ptr<Simulator> simulator_;
  Settings settings_;
  EventMemory events_;
  int pushed_ = std::max(0, period() - 3);
};

/// Times a simulator frame by frame, all frames of all clips equally often. Returns the mean time
/// of a frame, seconds.
inline double time_simulator(benchmark::State& state, const std::vector<Clip>& clips,
                             const MakeSimulator& make, const Settings& settings) {
  std::vector<std::unique_ptr<Playback>> playbacks;
  int frames = 0;
  for (const auto& clip : clips) {
    const LumaFormat format{clip.front().width(), clip.front().height(), 8};
    playbacks.push_back(std::make_unique<Playback>(clip, make(format), settings));
    frames += playbacks.back()->period();
  }
  double events = 0;
  const auto start = std::chrono::steady_clock::now();
  while (state.KeepRunningBatch(frames))
    for (const auto& playback : playbacks)
      for (int i = 0; i < playback->period(); ++i) events += static_cast<double>(playback->push());
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
  const auto count = static_cast<double>(state.iterations());
  state.counters["events"] = events / count;
  return time.count() / count;
}

}  // namespace bench
