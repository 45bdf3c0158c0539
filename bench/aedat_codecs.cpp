// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes AEDAT on one core: million events per second, and the time as a multiple of that
// of a memcpy of the decoded events in the same run. Names are FORMAT/read or write.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "bench/codec_timing.hpp"
#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "tests/formats/aedat_files.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize size{346, 260};
constexpr std::size_t count = 2'000'000;

/// Noise, many events of which have the same time.
std::vector<AbsoluteEvent> make_events() {
  std::mt19937 random(1);
  const auto below = [&](int limit) {
    return std::uniform_int_distribution<std::int64_t>(0, limit - 1)(random);
  };
  std::vector<AbsoluteEvent> events;
  Microseconds t = 0;
  while (events.size() < count) {
    const auto pause = below(200);
    t += pause == 0 ? below(1000) : pause < 4 ? below(10'000) : below(4) == 0 ? below(20) : 0;
    events.push_back(AbsoluteEvent::at(static_cast<int>(below(size.width)),
                                       static_cast<int>(below(size.height)), t,
                                       below(2) == 1 ? Polarity::on : Polarity::off));
  }
  return events;
}

const std::vector<AbsoluteEvent>& events() {
  static const auto made = make_events();
  return made;
}

/// Writes an AEDAT 4 file as aedatmux does, and calls take(bytes) for each of its buffers.
template <class Take>
void encode_aedat4(Aedat4Compression compression, const Take& take) {
  constexpr std::size_t buffer_size = 65'536;
  std::vector<std::uint8_t> bytes;
  Aedat4Encoder encoder({size, "bench", compression});
  for (std::span<const AbsoluteEvent> rest = events(); !rest.empty();) {
    const auto part = rest.first(std::min(buffer_size, rest.size()));
    bytes.clear();
    encoder.encode(part, bytes);
    take(bytes);
    rest = rest.subspan(part.size());
  }
  bytes.clear();
  encoder.finish(bytes);
  take(bytes);
}

/// Returns the number of events.
std::size_t decode_aedat4(const std::vector<std::uint8_t>& bytes) {
  Aedat4Decoder decoder;
  std::size_t decoded = 0;
  const auto take = [&] {
    while (const auto item = decoder.next()) {
      const auto& of_item = std::get<EventItem>(*item).events;
      benchmark::DoNotOptimize(of_item.data());
      decoded += of_item.size();
    }
  };
  bench::for_each_piece(bytes, [&](auto piece) {
    decoder.push(piece);
    take();
  });
  decoder.drain();
  take();
  return decoded;
}

void register_aedat4(const std::string& name, Aedat4Compression compression) {
  benchmark::RegisterBenchmark(("aedat4/" + name + "/read").c_str(), [=](benchmark::State& state) {
    std::vector<std::uint8_t> bytes;
    encode_aedat4(compression, [&](const auto& buffer) {
      bytes.insert(bytes.end(), buffer.begin(), buffer.end());
    });
    std::size_t decoded = 0;
    bench::measure(state, events(), [&] { decoded = decode_aedat4(bytes); });
    if (decoded != count) state.SkipWithError("events are missing");
  });
  benchmark::RegisterBenchmark(("aedat4/" + name + "/write").c_str(), [=](benchmark::State& state) {
    bench::measure(state, events(), [&] {
      encode_aedat4(compression,
                    [](const auto& buffer) { benchmark::DoNotOptimize(buffer.data()); });
    });
  });
}

template <class AnyDecoder, class Encode>
void register_reader(const std::string& name, const Encode& encode) {
  benchmark::RegisterBenchmark((name + "/read").c_str(), [=](benchmark::State& state) {
    const auto bytes = encode();
    Decoded out;
    std::size_t decoded = 0;
    bench::measure(state, events(), [&] {
      AnyDecoder decoder;
      decoded = 0;
      bench::for_each_piece(bytes, [&](auto piece) {
        out.events.clear();
        decoder.decode(piece, out);
        decoded += out.events.size();
      });
    });
    if (decoded != count) state.SkipWithError("events are missing");
  });
}

}  // namespace

int main(int argc, char** argv) {
  register_aedat4("none", Aedat4Compression::none);
  register_aedat4("lz4", Aedat4Compression::lz4);
  register_aedat4("zstd", Aedat4Compression::zstd);
  register_reader<Aedat2Decoder>(
      "aedat2", [] { return aedat_files::aedat2_davis(events(), size, "Davis346"); });
  register_reader<Aedat3Decoder>("aedat3",
                                 [] { return aedat_files::aedat3(events(), "DAVIS346", 4096); });
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
