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
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

constexpr SensorSize size = {1280, 720};

Bytes load(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void save(const std::string& path, const void* bytes, std::size_t count) {
  std::ofstream(path, std::ios::binary)
      .write(static_cast<const char*>(bytes), static_cast<std::streamsize>(count));
}

/// Nothing for HDF5, whose writer writes the file itself.
std::unique_ptr<Encoder> make_encoder(const std::string& kind) {
  if (kind == "npy") return std::make_unique<NpyEncoder>();
  if (kind == "npz") return make_npz_encoder(size);
  for (const auto& [name, description, format] : csv_formats())
    if (kind == name) return std::make_unique<CsvEncoder>(format, size);
  return nullptr;
}

void write_file(const std::string& kind, const std::string& file, const std::string& raw) {
  const auto memory = load(raw);
  Events events(memory.size() / sizeof(AbsoluteEvent));
  if (!events.empty()) std::memcpy(static_cast<void*>(events.data()), memory.data(), memory.size());
  if (const auto encoder = make_encoder(kind)) {
    auto bytes = encode(*encoder, events);
    apply_patch(*encoder, bytes);
    save(file, bytes.data(), bytes.size());
    return;
  }
  Hdf5Writer writer(
      file,
      {kind == "metavision-hdf5" ? Hdf5Format::metavision : Hdf5Format::dsec,
       kind == "dsec-gzip" ? Hdf5Writer::Compression::gzip : Hdf5Writer::Compression::none, size});
  writer.append(events);
  writer.close();
}

void read_file(const std::string& kind, const std::string& file, const std::string& raw) {
  Events events;
  Corruption corruption;
  MemoryBytes bytes(load(file));
  if (kind == "hdf5") {
    Hdf5Reader reader(bytes);
    while (reader.read(10'000, events) > 0) {
    }
    corruption = reader.corruption();
  } else if (kind == "npz") {
    const auto reader = make_npz_decoder();
    reader->open(bytes);
    while (const auto item = reader->next()) {
      const auto some = std::get<EventItem>(*item).events;
      events.insert(events.end(), some.begin(), some.end());
    }
    corruption = reader->corruption();
  } else {
    const std::unique_ptr<EventDecoder> decoder =
        kind == "npy" ? std::unique_ptr<EventDecoder>(std::make_unique<NpyDecoder>())
                      : std::make_unique<CsvDecoder>();
    events = decode(*decoder, load(file)).events;
    corruption = decoder->corruption();
  }
  save(raw, events.data(), events.size() * sizeof(AbsoluteEvent));
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
