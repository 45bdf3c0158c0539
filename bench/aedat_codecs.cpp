// SPDX-License-Identifier: LGPL-2.1-or-later
// Events per second read and written by the AEDAT codecs on one core, compared to a memcpy of the
// decoded events in the same run.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstring>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/random_events.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize size{346, 260};
constexpr std::size_t count = 2'000'000;
/// Bytes per decode call, as from a file source.
constexpr std::size_t piece = std::size_t{1} << 20;

const std::vector<AbsoluteEvent>& events() {
  static const auto made = random_events::make(size, count, 1, 0, {1000});
  return made;
}

std::vector<std::uint8_t> aedat4(Aedat4Compression compression) {
  Aedat4Encoder encoder({size, "bench", compression});
  std::vector<std::uint8_t> bytes;
  encoder.encode(events(), bytes);
  encoder.finish(bytes);
  return bytes;
}

void count_events(benchmark::State& state) {
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(count));
}

template <class Take>
void for_each_piece(std::span<const std::uint8_t> bytes, Take take) {
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(piece, bytes.size()));
    take(part);
    bytes = bytes.subspan(part.size());
  }
}

void copy(benchmark::State& state) {
  const auto& from = events();
  std::vector<AbsoluteEvent> to(count);
  for (auto _ : state) {
    std::memcpy(static_cast<void*>(to.data()), from.data(), count * sizeof(AbsoluteEvent));
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  count_events(state);
}
BENCHMARK(copy)->Name("memcpy")->Unit(benchmark::kMillisecond);

void decode_aedat4(benchmark::State& state, Aedat4Compression compression) {
  const auto bytes = aedat4(compression);
  for (auto _ : state) {
    Aedat4Decoder decoder;
    std::size_t decoded = 0;
    const auto take = [&] {
      while (const auto item = decoder.next()) {
        const auto& of_item = std::get<EventItem>(*item).events;
        benchmark::DoNotOptimize(of_item.data());
        decoded += of_item.size();
      }
    };
    for_each_piece(bytes, [&](auto part) {
      decoder.push(part);
      take();
    });
    decoder.finish();
    take();
    if (decoded != count) state.SkipWithError("events are missing");
  }
  count_events(state);
}
BENCHMARK_CAPTURE(decode_aedat4, none, Aedat4Compression::none)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_aedat4, lz4, Aedat4Compression::lz4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_aedat4, zstd, Aedat4Compression::zstd)->Unit(benchmark::kMillisecond);

void encode_aedat4(benchmark::State& state, Aedat4Compression compression) {
  std::vector<std::uint8_t> bytes;
  for (auto _ : state) {
    Aedat4Encoder encoder({size, "bench", compression});
    for (std::span<const AbsoluteEvent> rest = events(); !rest.empty();) {
      const auto part = rest.first(std::min<std::size_t>(65'536, rest.size()));
      bytes.clear();
      encoder.encode(part, bytes);
      benchmark::DoNotOptimize(bytes.data());
      rest = rest.subspan(part.size());
    }
    encoder.finish(bytes);
  }
  count_events(state);
}
BENCHMARK_CAPTURE(encode_aedat4, none, Aedat4Compression::none)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_aedat4, lz4, Aedat4Compression::lz4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(encode_aedat4, zstd, Aedat4Compression::zstd)->Unit(benchmark::kMillisecond);

template <class Format>
void decode(benchmark::State& state, const std::vector<std::uint8_t>& bytes) {
  Decoded out;
  for (auto _ : state) {
    Format decoder;
    std::size_t decoded = 0;
    for_each_piece(bytes, [&](auto part) {
      out.events.clear();
      decoder.decode(part, out);
      decoded += out.events.size();
    });
    if (decoded != count) state.SkipWithError("events are missing");
  }
  count_events(state);
}

void decode_aedat2(benchmark::State& state) {
  decode<Aedat2Decoder>(state, aedat_files::aedat2_davis(events(), size, "Davis346"));
}
BENCHMARK(decode_aedat2)->Unit(benchmark::kMillisecond);

void decode_aedat3(benchmark::State& state) {
  decode<Aedat3Decoder>(state, aedat_files::aedat3(events(), "DAVIS346", 4096));
}
BENCHMARK(decode_aedat3)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
