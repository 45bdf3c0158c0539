// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes tables of events on one core: million events per second, and the time as a
// multiple of that of a memcpy of the decoded events in the same run. Names are FORMAT/read or
// write.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "bench/codec_timing.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"

namespace {

using namespace eventcamera;

using Events = std::vector<AbsoluteEvent>;
using Bytes = std::vector<std::uint8_t>;

constexpr SensorSize size{1280, 720};
constexpr std::size_t count = 1 << 20;

/// Ten events per microsecond, from one second on: some in runs along rows, some at random pixels.
Events make_events() {
  std::mt19937 random(1);
  const auto below = [&](int end) {
    return static_cast<int>(random() % static_cast<unsigned>(end));
  };
  Events events;
  constexpr Microseconds start = 1'000'000;  // from 0 on, these times would be frame numbers
  while (events.size() < count) {
    const int y = below(size.height);
    int x = below(size.width);
    for (int run = below(2) == 0 ? 1 : below(30); run > 0 && x < size.width;
         --run, x += 1 + below(2))
      events.push_back(AbsoluteEvent::at(x, y,
                                         start + static_cast<Microseconds>(events.size() / 10),
                                         below(2) == 0 ? Polarity::off : Polarity::on));
  }
  events.resize(count);
  return events;
}

const Events& events() {
  static const Events events = make_events();
  return events;
}

template <class Make>
Bytes encode(const Make& make) {
  Bytes bytes;
  auto encoder = make();
  encoder.encode(events(), bytes);
  encoder.finish(bytes);
  return bytes;
}

template <class MakeEncoder, class MakeDecoder>
void add(const std::string& name, const MakeEncoder& make_encoder,
         const MakeDecoder& make_decoder) {
  benchmark::RegisterBenchmark((name + "/read").c_str(), [=](benchmark::State& state) {
    const auto bytes = encode(make_encoder);
    Decoded out;
    bench::measure(state, events(), [&] {
      out.events.clear();
      auto decoder = make_decoder();
      bench::for_each_piece(bytes, [&](auto piece) { decoder.decode(piece, out); });
      decoder.finish(out);
    });
    if (out.events.size() != count) state.SkipWithError("events are missing");
  });
  benchmark::RegisterBenchmark((name + "/write").c_str(), [=](benchmark::State& state) {
    Bytes bytes;
    bench::measure(state, events(), [&] {
      bytes.clear();
      auto encoder = make_encoder();
      encoder.encode(events(), bytes);
      encoder.finish(bytes);
    });
  });
}

void add_csv(const std::string& name) {
  const auto named = std::ranges::find(csv_formats(), name, &NamedCsvFormat::name);
  const auto format = named->format;
  add(
      "csv-" + name, [=] { return CsvEncoder(format, size); }, [] { return CsvDecoder(); });
}

void add_ecf() {
  constexpr std::size_t chunk = 16384;
  static_assert(count % chunk == 0);
  benchmark::RegisterBenchmark("ecf/read", [](benchmark::State& state) {
    std::vector<Bytes> chunks(count / chunk);
    for (std::size_t i = 0; i < chunks.size(); ++i)
      encode_ecf(std::span(events()).subspan(i * chunk, chunk), chunks[i]);
    Events out;
    bench::measure(state, events(), [&] {
      out.clear();
      for (const auto& bytes : chunks) decode_ecf(bytes, out);
    });
    if (out.size() != count) state.SkipWithError("events are missing");
  });
  benchmark::RegisterBenchmark("ecf/write", [](benchmark::State& state) {
    Bytes bytes;
    bench::measure(state, events(), [&] {
      bytes.clear();
      for (std::size_t i = 0; i < count; i += chunk)
        encode_ecf(std::span(events()).subspan(i, chunk), bytes);
    });
  });
}

void add_hdf5(const std::string& name, Hdf5Format format, Hdf5Writer::Compression compression) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("table_codecs." + name + "." + std::to_string(getpid()));
  const auto write = [=] {
    Hdf5Writer writer(path, {format, compression, size});
    writer.append(events());
    writer.close();
  };
  benchmark::RegisterBenchmark((name + "/read").c_str(), [=](benchmark::State& state) {
    write();
    std::ifstream file(path, std::ios::binary);
    MemoryBytes bytes({std::istreambuf_iterator<char>(file), {}});
    Events out;
    bench::measure(state, events(), [&] {
      out.clear();
      Hdf5Reader reader(bytes);
      while (reader.read(10'000, out) > 0) {
      }
    });
    std::filesystem::remove(path);
    if (out.size() != count) state.SkipWithError("events are missing");
  });
  benchmark::RegisterBenchmark((name + "/write").c_str(), [=](benchmark::State& state) {
    bench::measure(state, events(), write);
    std::filesystem::remove(path);
  });
}

}  // namespace

int main(int argc, char** argv) {
  for (const auto* const name : {"names", "metavision", "rpg"}) add_csv(name);
  add(
      "npy", [] { return NpyEncoder(); }, [] { return NpyDecoder({.size = size}); });
  add_ecf();
  add_hdf5("dsec", Hdf5Format::dsec, Hdf5Writer::Compression::none);
  add_hdf5("dsec-gzip", Hdf5Format::dsec, Hdf5Writer::Compression::gzip);
  add_hdf5("metavision", Hdf5Format::metavision, Hdf5Writer::Compression::none);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
