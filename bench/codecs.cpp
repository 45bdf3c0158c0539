// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes event formats on one core: million events per second, and the time as a multiple
// of that of a memcpy of the decoded events in the same run. Names are FORMAT/read and write.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <span>

#include "bench/codec_timing.hpp"
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/ros/mcap_encoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::Events;

constexpr SensorSize size{1280, 720};
constexpr SensorSize davis{346, 260};  ///< of AEDAT 2 and 3, which support few cameras
constexpr std::size_t count = 1 << 20;

/// Random pixels, 10 million per second: the worst case for formats that store rows and times once.
const Events& noise() {
  static const Events events = [] {
    recordings::Random random(1);
    Events made;
    for (std::size_t i = 0; i < count; ++i)
      made.push_back(AbsoluteEvent::at(
          recordings::below(random, size.width), recordings::below(random, size.height),
          static_cast<Microseconds>(i / 10),
          recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
    return made;
  }();
  return events;
}

/// Moving edges as from a simulator: every 4 ms, row by row, runs of several pixels. From one
/// second on, since small times in text may be frame numbers.
Events make_edges(SensorSize sensor) {
  recordings::Random random(2);
  Events events;
  for (Microseconds t = 1'000'000; events.size() < count; t += 4000) {
    for (int y = 0; y < sensor.height; ++y) {
      for (int x = recordings::below(random, 100); x < sensor.width;) {
        const auto polarity = recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on;
        const int end = std::min(sensor.width, x + 1 + recordings::below(random, 16));
        for (; x < end; ++x) events.push_back(AbsoluteEvent::at(x, y, t, polarity));
        x += recordings::below(random, 200);
      }
    }
  }
  events.resize(count);
  return events;
}

const Events& edges() {
  static const Events events = make_edges(size);
  return events;
}

using Write = std::function<void(Bytes& bytes)>;              ///< appends a file
using Read = std::function<std::size_t(const Bytes& bytes)>;  ///< returns the number of events

void add_read(const std::string& name, const Events& events, const Write& write, const Read& read) {
  benchmark::RegisterBenchmark((name + "/read").c_str(), [=, &events](benchmark::State& state) {
    Bytes bytes;
    write(bytes);
    std::size_t decoded = 0;
    bench::measure(state, events, [&] { decoded = read(bytes); });
    if (decoded != events.size()) state.SkipWithError("events are missing");
  })->Unit(benchmark::kMillisecond);
}

void add_write(const std::string& name, const Events& events, const Write& write) {
  benchmark::RegisterBenchmark((name + "/write").c_str(), [=, &events](benchmark::State& state) {
    Bytes bytes;
    bench::measure(state, events, [&] {
      bytes.clear();
      write(bytes);
    });
    state.counters["bytes/event"] =
        static_cast<double>(bytes.size()) / static_cast<double>(events.size());
  })->Unit(benchmark::kMillisecond);
}

/// Reads the events of any format, in pieces as a file source gives them.
std::size_t decode(Decoder& decoder, const Bytes& bytes) {
  std::size_t decoded = 0;
  const auto take = [&] {
    while (const auto item = decoder.next()) {
      const auto& events = std::get<EventItem>(*item).events;
      benchmark::DoNotOptimize(events.data());
      decoded += events.size();
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

using MakeEncoder = std::function<std::unique_ptr<Encoder>()>;
using MakeDecoder = std::function<std::unique_ptr<Decoder>()>;

void add(const std::string& name, const Events& events, const MakeEncoder& make_encoder,
         const MakeDecoder& make_decoder) {
  constexpr std::size_t buffer_size = 65'536;
  const auto write = [=, &events](Bytes& bytes) {
    const auto encoder = make_encoder();
    for (std::size_t i = 0; i < count; i += buffer_size)
      encoder->encode(std::span(events).subspan(i, buffer_size), bytes);
    encoder->finish(bytes);
  };
  add_read(name, events, write, [=](const Bytes& bytes) { return decode(*make_decoder(), bytes); });
  add_write(name, events, write);
}

void add_streams(const std::string& scene, const Events& events) {
  for (const auto& format : formats::all()) {
    if (format.name.starts_with("raw_")) continue;  // the header does not affect the speed
    add(
        scene + "/" + format.name, events, [=] { return format.make_encoder(size); },
        [=] { return format.make_decoder(size); });
  }
}

void add_mcap(const std::string& name, BagCompression compression) {
  add(
      "edges/" + name, edges(),
      [=] {
        return make_mcap_encoder({size, BagEvents::evt3, compression});
      },
      [] { return make_bag_decoder(""); });
}

void add_aedat4(const std::string& name, Aedat4Compression compression) {
  add(
      "aedat4/" + name, edges(),
      [=] {
        return std::make_unique<Aedat4Encoder>(Aedat4Settings{size, "bench", compression});
      },
      [] { return make_aedat4_decoder(); });
}

void add_csv(const std::string& name) {
  const auto format = std::ranges::find(csv_formats(), name, &NamedCsvFormat::name)->format;
  add(
      "csv-" + name, edges(), [=] { return make_csv_encoder(format, size); },
      [] { return make_csv_decoder(); });
}

void add_ecf() {
  constexpr std::size_t chunk = 16'384;
  const auto chunks = std::make_shared<std::vector<Bytes>>(count / chunk);
  const auto write = [=](Bytes& /*bytes*/) {
    for (std::size_t i = 0; i < chunks->size(); ++i) {
      (*chunks)[i].clear();
      encode_ecf(std::span(edges()).subspan(i * chunk, chunk), (*chunks)[i]);
    }
  };
  add_read("ecf", edges(), write, [=](const Bytes& /*bytes*/) {
    Events out;
    for (const auto& bytes : *chunks) decode_ecf(bytes, out);
    return out.size();
  });
  add_write("ecf", edges(), write);
}

void add_hdf5(const std::string& name, Hdf5Format format, Hdf5Writer::Compression compression) {
  const auto path =
      std::filesystem::temp_directory_path() / ("codecs." + name + "." + std::to_string(getpid()));
  const auto file = std::make_shared<std::unique_ptr<MemoryBytes>>();
  const auto write = [=](Bytes& /*bytes*/) {
    Hdf5Writer writer(path, {format, compression, size});
    writer.append(edges());
    writer.close();
  };
  const auto load = [=](Bytes& bytes) {
    write(bytes);
    std::ifstream in(path, std::ios::binary);
    *file = std::make_unique<MemoryBytes>(Bytes{std::istreambuf_iterator<char>(in), {}});
    std::filesystem::remove(path);
  };
  add_read(name, edges(), load, [=](const Bytes& /*bytes*/) {
    const auto decoder = make_hdf5_decoder();
    decoder->open(**file);
    std::size_t read = 0;
    while (const auto item = decoder->next()) read += std::get<EventItem>(*item).events.size();
    return read;
  });
  add_write(name, edges(), [=](Bytes& bytes) {
    write(bytes);
    std::filesystem::remove(path);
  });
}

}  // namespace

int main(int argc, char** argv) {
  add_streams("noise", noise());
  add_streams("edges", edges());
  add_mcap("mcap", BagCompression::none);
  add_mcap("mcap-lz4", BagCompression::lz4);
  add_mcap("mcap-zstd", BagCompression::zstd);
  const Events small = make_edges(davis);
  add_read(
      "aedat2", small,
      [&](Bytes& bytes) { bytes = aedat_files::aedat2_davis(small, davis, "Davis346"); },
      [](const Bytes& bytes) { return decode(*make_aedat2_decoder(), bytes); });
  add_read(
      "aedat3", small, [&](Bytes& bytes) { bytes = aedat_files::aedat3(small, "DAVIS346", 4096); },
      [](const Bytes& bytes) { return decode(*make_aedat3_decoder(), bytes); });
  add_aedat4("none", Aedat4Compression::none);
  add_aedat4("lz4", Aedat4Compression::lz4);
  add_aedat4("zstd", Aedat4Compression::zstd);
  for (const auto* const name : {"names", "metavision", "rpg"}) add_csv(name);
  add(
      "npy", edges(), [] { return std::make_unique<NpyEncoder>(); },
      [] { return make_npy_decoder(TableSettings{.size = size}); });
  add_ecf();
  add_hdf5("dsec", Hdf5Format::dsec, Hdf5Writer::Compression::none);
  add_hdf5("dsec-gzip", Hdf5Format::dsec, Hdf5Writer::Compression::gzip);
  add_hdf5("metavision", Hdf5Format::metavision, Hdf5Writer::Compression::none);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
