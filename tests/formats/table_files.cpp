// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes and reads tables of events for scripts: table_files write|read KIND FILE RAW. RAW contains
// AbsoluteEvents in memory layout. Prints the corruption of a file that is read.
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "src/formats/hdf5/hdf5_reader.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize size = {1280, 720};

std::vector<std::uint8_t> load(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  return {text.begin(), text.end()};
}

void save(const std::string& path, const void* bytes, std::size_t count) {
  std::ofstream(path, std::ios::binary)
      .write(static_cast<const char*>(bytes), static_cast<std::streamsize>(count));
}

void write_file(const std::string& kind, const std::string& file, const std::string& raw) {
  const auto bytes = load(raw);
  std::vector<AbsoluteEvent> events(bytes.size() / sizeof(AbsoluteEvent));
  if (!events.empty())
    std::memcpy(static_cast<void*>(events.data()), bytes.data(),
                events.size() * sizeof(AbsoluteEvent));
  std::vector<std::uint8_t> out;
  if (kind == "npy") {
    NpyEncoder encoder;
    encoder.encode(events, out);
    encoder.finish(out);
    const auto patch = encoder.patch().value();
    std::memcpy(out.data() + patch.position, patch.bytes.data(), patch.bytes.size());
    save(file, out.data(), out.size());
    return;
  }
  if (kind == "npz") {
    const auto encoder = make_npz_encoder(size);
    encoder->encode(events, out);
    while (encoder->finish(out)) continue;
    save(file, out.data(), out.size());
    return;
  }
  for (const auto& [name, description, format] : csv_formats()) {
    if (kind != name) continue;
    CsvEncoder encoder(format, size);
    encoder.encode(events, out);
    encoder.finish(out);
    save(file, out.data(), out.size());
    return;
  }
  Hdf5Writer::Settings settings;
  settings.size = size;
  settings.format = kind == "metavision-hdf5" ? Hdf5Format::metavision : Hdf5Format::dsec;
  settings.compression =
      kind == "dsec-gzip" ? Hdf5Writer::Compression::gzip : Hdf5Writer::Compression::none;
  Hdf5Writer writer(file, settings);
  writer.append(events);
  writer.close();
}

void read_file(const std::string& kind, const std::string& file, const std::string& raw) {
  Decoded out;
  Corruption corruption;
  if (kind == "hdf5") {
    MemoryBytes bytes(load(file));
    Hdf5Reader reader(bytes);
    while (reader.read(10'000, out.events) > 0) {
    }
    corruption = reader.corruption();
  } else if (kind == "npz") {
    MemoryBytes bytes(load(file));
    const auto reader = make_npz_decoder();
    reader->open(bytes);
    while (const auto item = reader->next()) {
      const auto events = std::get<EventItem>(*item).events;
      out.events.insert(out.events.end(), events.begin(), events.end());
    }
    corruption = reader->corruption();
  } else {
    const std::unique_ptr<EventDecoder> decoder =
        kind == "npy" ? std::unique_ptr<EventDecoder>(std::make_unique<NpyDecoder>())
                      : std::make_unique<CsvDecoder>();
    decoder->decode(load(file), out);
    decoder->finish(out);
    corruption = decoder->corruption();
  }
  save(raw, out.events.data(), out.events.size() * sizeof(AbsoluteEvent));
  std::printf("%d %d %s\n", static_cast<int>(corruption.places),
              static_cast<int>(corruption.outside), corruption.first.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  try {
    (std::string(argv[1]) == "write" ? write_file : read_file)(argv[2], argv[3], argv[4]);
  } catch (const std::exception& error) {
    std::printf("%s\n", error.what());
    return 1;
  }
  return 0;
}
