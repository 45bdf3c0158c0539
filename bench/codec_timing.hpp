// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace bench {

/// CPU time of this thread, which does not depend on the load of the machine.
inline double seconds_now() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Time of a memcpy of these events in seconds, minimum of several runs.
template <class AnyEvent>
double memcpy_seconds(const std::vector<AnyEvent>& events) {
  std::vector<AnyEvent> copy(events.size());
  double best = 1;
  for (int i = 0; i < 20; ++i) {
    const double start = seconds_now();
    std::memcpy(static_cast<void*>(copy.data()), events.data(), events.size() * sizeof events[0]);
    benchmark::DoNotOptimize(copy.data());
    benchmark::ClobberMemory();
    best = std::min(best, seconds_now() - start);
  }
  return best;
}

/// Times `body`, which processes all of these events: million events per second, and the time as a
/// multiple of a memcpy of them.
template <class AnyEvent, class Body>
void measure(benchmark::State& state, const std::vector<AnyEvent>& events, const Body& body) {
  body();
  double seconds = 0;
  for (auto _ : state) {
    const double start = seconds_now();
    body();
    seconds += seconds_now() - start;
  }
  seconds /= static_cast<double>(state.iterations());
  state.counters["Mevents/s"] = static_cast<double>(events.size()) / seconds / 1e6;
  state.counters["memcpys"] = seconds / memcpy_seconds(events);
}

/// Calls take() with pieces of the bytes of a file, as a file source reads them.
template <class Take>
void for_each_piece(std::span<const std::uint8_t> bytes, const Take& take) {
  constexpr std::size_t max_size = std::size_t{1} << 20;
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min(max_size, bytes.size()));
    take(piece);
    bytes = bytes.subspan(piece.size());
  }
}

}  // namespace bench
