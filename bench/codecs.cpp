// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes event formats on one core: million events per second, and the time as a multiple
// of that of a memcpy of the decoded events in the same run. Names are RECORDING/FORMAT/read or
// write.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <span>

#include "bench/codec_timing.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/ros/mcap_encoder.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize size{1280, 720};
constexpr std::size_t count = 1 << 20;

struct Recording {
  std::string name;
  std::vector<AbsoluteEvent> events;
};

/// Random pixels, 10 million per second: the worst case for formats that store rows and times once.
Recording noise() {
  recordings::Random random(1);
  Recording recording{"noise", {}};
  for (std::size_t i = 0; i < count; ++i)
    recording.events.push_back(
        AbsoluteEvent::at(recordings::below(random, size.width),
                          recordings::below(random, size.height), static_cast<Microseconds>(i / 10),
                          recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
  return recording;
}

/// Moving edges as from a simulator: every 4 ms, row by row, runs of several pixels.
Recording edges() {
  recordings::Random random(2);
  Recording recording{"edges", {}};
  for (Microseconds t = 4000; recording.events.size() < count; t += 4000) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = recordings::below(random, 100); x < size.width;) {
        const auto polarity = recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on;
        const int end = std::min(size.width, x + 1 + recordings::below(random, 16));
        for (; x < end; ++x) recording.events.push_back(AbsoluteEvent::at(x, y, t, polarity));
        x += recordings::below(random, 200);
      }
    }
  }
  recording.events.resize(count);
  return recording;
}

void register_all(const Recording& recording) {
  for (const auto& format : formats::all()) {
    // The header does not affect the speed.
    if (format.name.rfind("raw_", 0) == 0) continue;
    const auto bytes = recordings::encode(*format.make_encoder(size), recording.events);
    const auto add = [&](const char* what, auto&& body) {
      benchmark::RegisterBenchmark((recording.name + "/" + format.name + "/" + what).c_str(), body)
          ->Unit(benchmark::kMillisecond);
    };
    add("read", [&recording, format, bytes](benchmark::State& state) {
      Decoded decoded;
      bench::measure(state, recording.events, [&] {
        decoded.events.clear();
        format.make_decoder(size)->decode(bytes, decoded);
      });
      if (decoded.events != recording.events) state.SkipWithError("other events");
    });
    add("write", [&recording, format](benchmark::State& state) {
      std::vector<std::uint8_t> written;
      bench::measure(state, recording.events, [&] {
        written.clear();
        format.make_encoder(size)->encode(recording.events, written);
      });
      state.counters["bytes/event"] =
          static_cast<double>(written.size()) / static_cast<double>(recording.events.size());
    });
  }
}

/// MCAP files with EVT3 words, pushed as from a file source.
void register_mcap(const Recording& recording, BagCompression compression, const char* name) {
  const auto write = [&recording, compression](std::vector<std::uint8_t>& bytes) {
    bytes.clear();
    const auto encoder = make_mcap_encoder({size, BagEvents::evt3, compression});
    encoder->encode(recording.events, bytes);
    encoder->finish(bytes);
  };
  const auto add = [&](const char* what, auto&& body) {
    benchmark::RegisterBenchmark((recording.name + "/" + name + "/" + what).c_str(), body)
        ->Unit(benchmark::kMillisecond);
  };
  add("read", [&recording, write](benchmark::State& state) {
    std::vector<std::uint8_t> bytes;
    write(bytes);
    std::size_t decoded = 0;
    bench::measure(state, recording.events, [&] {
      BagDecoder decoder("");
      decoded = 0;
      const auto take = [&] {
        while (const auto item = decoder.next())
          decoded += std::get<EventItem>(*item).events.size();
      };
      bench::for_each_piece(bytes, [&](auto piece) {
        decoder.push(piece);
        take();
      });
      decoder.drain();
      take();
    });
    if (decoded != recording.events.size()) state.SkipWithError("events are missing");
  });
  add("write", [&recording, write](benchmark::State& state) {
    std::vector<std::uint8_t> bytes;
    bench::measure(state, recording.events, [&] { write(bytes); });
    state.counters["bytes/event"] =
        static_cast<double>(bytes.size()) / static_cast<double>(recording.events.size());
  });
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Recording recordings[] = {noise(), edges()};
  for (const auto& recording : recordings) register_all(recording);
  const auto& with_edges = recordings[1];
  register_mcap(with_edges, BagCompression::none, "mcap");
  register_mcap(with_edges, BagCompression::lz4, "mcap-lz4");
  register_mcap(with_edges, BagCompression::zstd, "mcap-zstd");
  benchmark::RunSpecifiedBenchmarks();
}
