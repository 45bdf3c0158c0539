// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes and reads files of events for scripts:
//   table_files write KIND FILE RAW
//   table_files read KIND FILE RAW [columns=LETTERS] [unit=NUMBER] [path=PATH] [seek=MICROSECONDS]
// RAW contains AbsoluteEvents in memory layout. Prints what else there is to know of a file that is
// read: corrupt places, the position of the first, events outside the sensor, width, height and
// last time, and then the first corruption and the streams that are not read.
#include <array>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <string>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

using Options = std::map<std::string, std::string>;

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
    if (kind == name) return make_csv_encoder(format, size);
  return nullptr;
}

/// Edges, samples, events and a frame of threes.
Bytes aedat4_of(const Events& events, int compression, bool has_table) {
  constexpr std::array<Trigger, 3> edges{{{1001, 0, true}, {1002, 0, false}, {1003, 3, true}}};
  constexpr std::array<ImuSample, 2> samples{
      {{1004, 40, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}},
       {1005, 39, {-1, -2, -3}, {-4, -5, -6}, {-7, -8, -9}}}};
  const Bytes pixels(static_cast<std::size_t>(size.width * size.height), 3);
  Aedat4Encoder encoder({size, "a <b> & c", static_cast<Aedat4Compression>(compression), true,
                         has_table, true, true});
  Bytes bytes;
  encoder.encode(std::span<const Trigger>(edges), bytes);
  encoder.encode(std::span<const ImuSample>(samples), bytes);
  encoder.encode(events, bytes);
  encoder.encode({events.back().t, 0, 0, 0, 0, PixelFormat::grey8, size.width, size.height, 0, 0,
                  pixels.data(), size.width},
                 bytes);
  encoder.finish(bytes);
  apply_patch(encoder, bytes);
  return bytes;
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
  if (kind.starts_with("aedat4")) {
    const auto bytes = aedat4_of(events, kind[6] - '0', kind.ends_with("table"));
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

std::unique_ptr<Decoder> make_decoder(const std::string& kind, Options& options) {
  TableSettings settings;
  if (const auto& letters = options["columns"]; !letters.empty())
    settings.columns = columns_of(letters).value();
  if (const auto& unit = options["unit"]; !unit.empty())
    settings.unit = static_cast<TimeUnit>(std::stoi(unit));
  if (kind == "hdf5") return make_hdf5_decoder({.path = options["path"], .table = settings});
  if (kind == "npz") return make_npz_decoder(settings);
  if (kind == "npy") return make_npy_decoder(settings);
  return make_csv_decoder(settings);
}

/// Reads a file with random access, and expects the same events in pieces.
void read_file(const std::string& kind, const std::string& file, const std::string& raw,
               Options options) {
  const auto bytes = load(file);
  MemoryBytes source(bytes);
  const auto decoder = make_decoder(kind, options);
  Contents contents;
  if (!decoder->open(source)) {
    contents = decode(*decoder, bytes);
  } else {
    // Forwards and, after everything has been read, backwards.
    const auto read = [&] {
      Contents some;
      if (const auto& t = options["seek"]; !t.empty())
        decoder->restart(decoder->seek_point_before(std::stoll(t)).value());
      some.take_all(*decoder);
      return some;
    };
    contents = read();
    if (!options["seek"].empty() && read().events != contents.events)
      throw std::logic_error("other events after a seek backwards");
  }
  if (options["seek"].empty() &&
      decode(*make_decoder(kind, options), bytes, 0).events != contents.events)
    throw std::logic_error("other events in pieces");
  save(raw, contents.events.data(), contents.events.size() * sizeof(AbsoluteEvent));
  const auto& corruption = decoder->corruption();
  const auto sensor = decoder->streams().front().size;
  std::cout << corruption.places << ' ' << corruption.first_at << ' ' << corruption.outside << ' '
            << sensor.width << ' ' << sensor.height << ' ' << decoder->last_time().value_or(-1)
            << ' ' << corruption.first << decoder->unread_streams().names << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) return 2;
  Options options;
  for (const std::string word : std::span(argv, static_cast<std::size_t>(argc)).subspan(5))
    options[word.substr(0, word.find('='))] = word.substr(word.find('=') + 1);
  try {
    if (std::string(argv[1]) == "write")
      write_file(argv[2], argv[3], argv[4]);
    else
      read_file(argv[2], argv[3], argv[4], options);
  } catch (const std::exception& error) {
    std::cout << error.what() << '\n';
    return 1;
  }
  return 0;
}
