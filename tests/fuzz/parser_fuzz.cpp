// SPDX-License-Identifier: LGPL-2.1-or-later
// Parsers of a piece of bytes; the environment variable FORMAT names one of them.
#include <hdf5.h>

#include <bit>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "gst/simulator/camera_profile.hpp"
#include "src/filter/camera_calibration.hpp"
#include "src/filter/hot_pixel_filter.hpp"
#include "src/filter/pixel_mask.hpp"
#include "src/filter/undistort_filter.hpp"
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/compressed_file.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/file_formats.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_filters.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/recording_reader.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

using Input = std::span<const std::uint8_t>;
using Parser = std::function<void(Input)>;

std::string_view text_of(Input bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

template <class Make>
Parser decoder_of(const Make& make, std::size_t events_per_byte = 1) {
  return [make, events_per_byte](Input bytes) { check_decoder(make, bytes, events_per_byte); };
}

Parser words(EvtFormat format) {
  return decoder_of([format] { return make_evt_decoder(format, {640, 480}); }, 6);
}

/// Hash of all items of one kind.
class Sum {
 public:
  void add(std::uint64_t number) { sum_ = (sum_ ^ number) * 0x9E3779B97F4A7C15U + (sum_ >> 29); }

  void add(const EventItem& item) {
    for (const auto& event : item.events) {
      add(static_cast<std::uint64_t>(event.t));
      add(std::uint64_t{event.x} << 16 | event.y_p);
    }
  }
  void add(const FrameItem& item) {
    const auto& frame = item.frame;
    add(static_cast<std::uint64_t>(frame.t));
    for (std::ptrdiff_t i = 0; i < frame.stride * frame.height; ++i) add(frame.pixels[i]);
  }
  void add(const TriggerItem& item) {
    for (const auto& trigger : item.triggers) {
      add(static_cast<std::uint64_t>(trigger.t));
      add(std::uint64_t{trigger.id} << 1 | (trigger.rising ? 1U : 0U));
    }
  }
  void add(const ImuItem& item) {
    for (const auto& sample : item.samples) {
      add(static_cast<std::uint64_t>(sample.t));
      add(std::bit_cast<std::uint32_t>(sample.temperature));
      for (const auto& vector : {sample.acceleration, sample.rotation, sample.magnetic_field})
        for (const float number : vector) add(std::bit_cast<std::uint32_t>(number));
    }
  }
  void add(const Corruption& corruption) {
    add(corruption.places);
    add(corruption.first_at);
    add(corruption.outside);
  }

  friend bool operator==(const Sum&, const Sum&) = default;

 private:
  std::uint64_t sum_ = 0;
};

/// A hash per kind: in some formats, the interleaving of events and triggers may depend on the
/// split.
struct Sums {
  Sum events, pictures, triggers, imu_samples, rest;

  void add(const EventItem& item) { events.add(item); }
  void add(const FrameItem& item) { pictures.add(item); }
  void add(const TriggerItem& item) { triggers.add(item); }
  void add(const ImuItem& item) { imu_samples.add(item); }

  friend bool operator==(const Sums&, const Sums&) = default;
};

void take(Decoder& reader, Sums& sums) {
  while (const auto item = reader.next()) {
    std::visit([&](const auto& some) { sums.add(some); }, *item);
    if (const auto* const some = std::get_if<EventItem>(&*item)) {
      require(some->stream < reader.streams().size(), "events are of a stream");
      require_within(reader.streams()[some->stream].size, some->events);
    }
  }
}

/// Complete output of a decoder that is pushed, and then drained; nothing of a file that it
/// refuses.
Sums sums_of(Decoder& reader, std::span<const std::uint8_t> bytes, Pieces pieces) {
  Sums sums;
  try {
    in_pieces(bytes, pieces, [&](auto piece) {
      reader.push(piece);
      take(reader, sums);
    });
    reader.drain();
    take(reader, sums);
  } catch (const UnsupportedFormat&) {
    sums.rest.add(std::uint64_t{1});
    return sums;
  }
  sums.rest.add(reader.corruption());
  sums.rest.add(reader.streams().size());
  return sums;
}

/// Versions 1.0 and 2.0, as the first line says.
void aedat2(Input bytes) {
  constexpr std::size_t version_at = 9;
  const bool is_first = bytes.size() > version_at && bytes[version_at] == '1';
  const auto version = is_first ? Aedat2Version::one : Aedat2Version::two;
  check_decoder([version] { return make_aedat2_decoder(SensorSize{}, version); }, bytes, 1);
}

/// Seeks to the last events according to the table, or back to the start.
void seek_by_table(Decoder& reader, std::span<const std::uint8_t> bytes) {
  const auto header = read_aedat4_header(bytes).value();
  auto position = header.packets_at;
  if (header.table_at && *header.table_at < bytes.size()) {
    const auto at = static_cast<std::size_t>(*header.table_at);
    const auto table = read_aedat4_table(bytes.subspan(at), header.compression, header.packets_at);
    if (table && !table->empty())
      position = aedat4_position_of(*table, table->back().end).value_or(position);
  }
  reader.restart({.position = position});
  if (position < bytes.size()) reader.push(bytes.subspan(static_cast<std::size_t>(position)));
  Sums sums;
  take(reader, sums);
  reader.drain();
  take(reader, sums);
}

/// AEDAT 4, through the decoder of all versions, and its packet table.
void aedat4(Input bytes) {
  require_same_however_cut(bytes, [&](Pieces pieces) {
    const auto reader = make_aedat_decoder();
    const auto sums = sums_of(*reader, bytes, pieces);
    const bool is_read = !reader->streams().empty() && reader->format_name() == "AEDAT 4.0";
    if (is_read && pieces.max_size == 0) seek_by_table(*reader, bytes);
    return sums;
  });
}

/// Seeks to the time of the last event, and reads the rest.
void seek(Decoder& reader, std::span<const std::uint8_t> bytes, Microseconds t) {
  const auto point = reader.seek_point_before(t);
  if (!point) return;
  reader.restart(*point);
  if (point->position < bytes.size())
    reader.push(bytes.subspan(static_cast<std::size_t>(point->position)));
  Sums sums;
  take(reader, sums);
  reader.drain();
  take(reader, sums);
}

void read_with_index(std::span<const std::uint8_t> bytes) {
  const auto reader = make_bag_decoder("");
  MemoryBytes source({bytes.begin(), bytes.end()});
  Sums sums;
  try {
    const bool reads_itself = reader->open(source);
    if (!reads_itself) {
      reader->push(bytes);
      take(*reader, sums);
      reader->drain();
    }
    take(*reader, sums);
    const auto last = reader->last_time();
    if (reads_itself) bytes = {};
    seek(*reader, bytes, last.value_or(1'000'000));
    seek(*reader, bytes, std::numeric_limits<Microseconds>::min());
  } catch (const UnsupportedFormat&) {
  }
}

/// Plays a file, whose streams may begin anywhere, and a part of it.
void play(std::span<const std::uint8_t> bytes) {
  constexpr Microseconds chunk_length = 10'000;
  MemoryBytes source({bytes.begin(), bytes.end()});
  RecordingReader recording([] { return make_bag_decoder(""); }, chunk_length);
  recording.open(source);
  const auto play_on = [&] {
    while (const auto output = recording.next()) {
      const auto* const chunk = std::get_if<RecordingReader::Chunk>(&*output);
      if (chunk == nullptr) continue;
      const auto size = recording.streams()[chunk->stream].info.size;
      for (const auto& event : chunk->events)
        require(event.x < size.width && event.y() < size.height, "events are within the sensor");
    }
  };
  try {
    play_on();
    recording.seek(recording.position() / 2, std::nullopt);
    play_on();
  } catch (const UnsupportedFormat&) {
  }
}

void bag(Input bytes) {
  const auto outcome = [&](Pieces pieces) {
    const auto reader = make_bag_decoder("");
    return sums_of(*reader, bytes, pieces);
  };
  // Of a corrupt page, SQLite at times gives what its memory held before.
  if (has_at(0, sqlite_magic, bytes))
    outcome({});
  else
    require_same_however_cut(bytes, outcome);
  read_with_index(bytes);
  play(bytes);
}

/// Whatever a file says, events stay within the sensor.
void calibration(Input bytes) {
  constexpr SensorSize sensor{6, 4};
  try {
    const UndistortFilter filter(sensor, parse_calibration(text_of(bytes)));
    std::vector<Event> events;
    for (int y = 0; y < sensor.height; ++y)
      for (int x = 0; x < sensor.width; ++x) events.push_back(Event::at(x, y, 0, Polarity::on));
    for (const auto& event : filter.filter({events, {}}).events)
      require(
          event.x < sensor.width && event.y() < sensor.height && event.polarity() == Polarity::on,
          "events stay within the sensor");
  } catch (const std::invalid_argument&) {  // no calibration
  }
}

void camera_profile(Input bytes) {
  try {
    for (const auto& [name, value] :
         parse_camera_profile(std::string(text_of(bytes)), "eventsim-dvs"))
      require(!name.empty() && value.size() <= bytes.size(), "entries come from the text");
  } catch (const std::runtime_error&) {  // no profile
  }
}

auto content_of(std::span<const std::uint8_t> bytes, Pieces pieces) {
  constexpr std::size_t max_content = std::size_t{1} << 20;
  FileDecompressor decompressor;
  std::vector<std::uint8_t> content;
  const auto add_all = [&] {
    while (content.size() < max_content) {
      const auto part = decompressor.next();
      if (part.empty()) break;
      content.insert(content.end(), part.begin(), part.end());
    }
  };
  in_pieces(bytes, pieces, [&](auto piece) {
    if (content.size() >= max_content) return;
    decompressor.push(piece);
    add_all();
  });
  decompressor.finish();
  add_all();
  const bool is_whole = content.size() < max_content;
  const auto corrupt_at = is_whole ? decompressor.corrupt_at() : std::nullopt;
  require(corrupt_at.value_or(0) <= bytes.size(), "corruption is within the file");
  if (!decompressor.is_compressed())
    require(std::ranges::equal(content, bytes), "other files are the same");
  // libzstd may return more before a corrupt place, the smaller the pieces.
  content.resize(corrupt_at ? 0 : std::min(content.size(), max_content));
  return std::tuple(content, decompressor.is_compressed(), corrupt_at.has_value());
}

/// Files that gzip or zstd has compressed, and others, which are returned as they are.
void compressed(Input bytes) {
  require_same_however_cut(bytes, [&](Pieces pieces) { return content_of(bytes, pieces); });
}

void ecf(Input bytes) {
  std::vector<AbsoluteEvent> events;
  const bool sound = decode_ecf(bytes, events);
  require(events.size() <= ecf_max_events, "memory is bounded");
  require(sound || events.empty(), "a corrupt chunk has no events");
}

/// Reads a file, seeks, and reads again.
void hdf5(Input bytes) {
  try {
    MemoryBytes source({bytes.begin(), bytes.end()});
    const auto decoder = make_hdf5_decoder();
    decoder->open(source);
    // A few compressed bytes can be many events.
    constexpr std::size_t max_events = 100'000;
    std::vector<AbsoluteEvent> events;
    const auto read = [&] {
      const auto item = decoder->next();
      if (const auto* const some = item ? std::get_if<EventItem>(&*item) : nullptr)
        events.insert(events.end(), some->events.begin(), some->events.end());
      return item.has_value();
    };
    while (events.size() < max_events && read()) continue;
    if (const auto last = decoder->last_time()) decoder->restart({.t = *last / 2});
    read();
    require_within(decoder->streams().front().size, events);
  } catch (const std::runtime_error&) {
    // Invalid files must be reported.
  }
}

class SmallHdf5 {
 public:
  explicit SmallHdf5(const std::string& name) {
    const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_fapl_core(access.get(), 1024, false);
    file_ = {H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose};
  }

  hid_t id() const { return file_.get(); }

  void group(const char* name) {
    H5Gclose(H5Gcreate2(id(), name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  }

  /// In chunks of `chunk` rows, each stored as these bytes.
  void stored_dataset(const char* name, hid_t type, const std::vector<hsize_t>& extent,
                      hsize_t chunk, const std::vector<int>& filters,
                      const std::vector<std::span<const std::uint8_t>>& chunks) {
    const auto rank = static_cast<int>(extent.size());
    const Hdf5Handle space(H5Screate_simple(rank, extent.data(), nullptr), H5Sclose);
    const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    auto sides = extent;
    sides[0] = chunk;
    H5Pset_chunk(creation.get(), rank, sides.data());
    for (const int filter : filters)
      if (filter != 0) H5Pset_filter(creation.get(), filter, H5Z_FLAG_OPTIONAL, 0, nullptr);
    const Hdf5Handle dataset(
        H5Dcreate2(id(), name, type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
        H5Dclose);
    std::vector<hsize_t> offset(extent.size());
    for (const auto bytes : chunks) {
      if (offset[0] >= extent[0]) break;
      H5Dwrite_chunk(dataset.get(), H5P_DEFAULT, 0, offset.data(), bytes.size(), bytes.data());
      offset[0] += chunk;
    }
  }

  std::vector<std::uint8_t> bytes() const {
    H5Fflush(id(), H5F_SCOPE_GLOBAL);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(H5Fget_file_image(id(), nullptr, 0)));
    H5Fget_file_image(id(), bytes.data(), bytes.size());
    return bytes;
  }

 private:
  Hdf5Handle file_;
};

Hdf5Handle metavision_event_type() {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, 16), H5Tclose);
  H5Tinsert(type.get(), "x", 0, H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "y", 2, H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "p", 4, H5T_NATIVE_INT16);
  H5Tinsert(type.get(), "t", 8, H5T_NATIVE_INT64);
  return type;
}

hid_t number_type(unsigned choice) {
  const hid_t types[] = {H5T_STD_U32LE, H5T_STD_I64BE, H5T_STD_U8LE,
                         H5T_STD_I16LE, H5T_STD_U64LE, H5T_STD_I8LE};
  return types[choice % 6];
}

/// Arbitrary bytes as the chunks of a valid HDF5 file. The first five bytes are the layout, the
/// filters, the rows of a chunk, the rows of the file, and the number type.
void hdf5_chunk(Input input) {
  if (input.size() < 5) return;
  const std::vector<int> filters = {(input[1] & 2) != 0 ? H5Z_FILTER_SHUFFLE : 0,
                                    (input[1] & 1) != 0 ? H5Z_FILTER_DEFLATE : 0};
  const hsize_t chunk = 1U + input[2];
  const hsize_t rows = 1U + input[3];
  const auto number = number_type(input[4]);
  const auto bytes = input.subspan(5);
  const std::vector chunks = {bytes, bytes.first(bytes.size() / 2), bytes};
  std::vector<std::uint8_t> image;
  {
    const Hdf5Session session;
    SmallHdf5 file("fuzz");
    switch (input[0] % 4) {
      case 0:
        file.group("events");
        for (const auto* const name : {"events/t", "events/x", "events/y", "events/p"})
          file.stored_dataset(name, number, {rows}, chunk, filters, chunks);
        file.stored_dataset("ms_to_idx", number, {rows}, chunk, filters, chunks);
        file.stored_dataset("t_offset", number, {1}, chunk, filters, chunks);
        break;
      case 1:
        file.stored_dataset("events", number, {rows, 4}, chunk, filters, chunks);
        break;
      default: {
        file.group("CD");
        const auto type = metavision_event_type();
        const bool ecf = input[0] % 4 == 2;
        file.stored_dataset("CD/events", type.get(), {rows}, chunk,
                            ecf ? std::vector{ecf_filter} : filters, chunks);
        write_text_attribute(file.id(), "geometry", "640x480");
      }
    }
    image = file.bytes();
  }
  hdf5(image);
}

/// The first five bytes are three filters, those that are not applied, and the size of a number.
void hdf5_filters(Input bytes) {
  constexpr std::size_t before = 5;
  if (bytes.size() < before) return;
  constexpr int known[] = {H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32,
                           lzf_filter};
  const int filters[] = {known[bytes[0] % 4], known[bytes[1] % 4], known[bytes[2] % 4]};
  const std::size_t number_bytes = 1 + bytes[4] % 16;
  const auto chunk_bytes = 16 * number_bytes;
  std::vector<std::uint8_t> chunk(bytes.begin() + before, bytes.end());
  const bool sound = undo_hdf5_filters(filters, bytes[3], number_bytes, chunk_bytes, chunk);
  require(!sound || chunk.size() == chunk_bytes, "a sound chunk is whole");
  require(chunk.capacity() <= std::max(bytes.size(), chunk_bytes + 64), "memory is bounded");
}

void mask(Input bytes) {
  try {
    PixelMask::parse_png(text_of(bytes), {8, 4});
  } catch (const std::runtime_error&) {  // no picture, or of another size
  }
}

void npz(Input bytes) {
  try {
    MemoryBytes source({bytes.begin(), bytes.end()});
    const auto reader = make_npz_decoder();
    reader->open(source);
    // A few compressed bytes can be many events.
    constexpr std::size_t max_events = 1'000'000;
    for (std::size_t count = 0; count < max_events;) {
      const auto item = reader->next();
      if (!item) break;
      const auto events = std::get<EventItem>(*item).events;
      require(!events.empty() && events.size() <= 65'536, "events come in pieces");
      count += events.size();
    }
    const auto& corruption = reader->corruption();
    require((corruption.places == 0) == corruption.first.empty(), "corruption says what it is");
  } catch (const UnsupportedFormat& error) {
    require(error.what()[0] != 0, "an error says why");
  }
}

void pixel_list(Input bytes) {
  try {
    const auto pixels = parse_pixel_list(text_of(bytes));
    require(parse_pixel_list(pixel_list_text(pixels)) == pixels,
            "a list is read as it was written");
  } catch (const std::invalid_argument&) {
  }
}

Likelihood exact_likelihood(const FileFormat& format, Input bytes) {
  Likelihood found = Likelihood::none;
  // In memory of their own, so that sanitizers detect reads past their end.
  in_pieces(bytes, {}, [&](auto all) { found = likelihood(format, all); });
  return found;
}

void recognition(Input bytes) {
  std::size_t chance = bytes.size();
  for (const auto byte : bytes) chance = chance * 31 + byte;
  for (const auto& format : file_formats()) {
    const auto whole = exact_likelihood(format, bytes);
    for (const auto count : {chance % (bytes.size() + 1), bytes.size() / 2}) {
      const auto start = exact_likelihood(format, bytes.first(count));
      if (start == Likelihood::none || start == whole) continue;
      require(format.media_type == std::string_view("application/x-event-csv"),
              "what is recognised stays so as bytes are added");
    }
  }
}

const Parser& parser() {
  static const std::map<std::string, Parser> parsers = {
      {"aedat2", aedat2},
      {"aedat3", decoder_of([] { return make_aedat3_decoder(); })},
      {"aedat4", aedat4},
      {"atis", decoder_of([] {
         return make_atis_bin_decoder({34, 34});
       })},
      {"bag", bag},
      {"calibration", calibration},
      {"camera_profile", camera_profile},
      {"compressed", compressed},
      {"csv", decoder_of([] { return make_csv_decoder(); })},
      {"dat", decoder_of([] { return make_dat_decoder(); })},
      {"ecf", ecf},
      {"es", decoder_of([] { return make_event_stream_decoder(); })},
      {"evt2", words(EvtFormat::evt2)},
      {"evt21", words(EvtFormat::evt21)},
      {"evt21_legacy", words(EvtFormat::evt21_legacy)},
      {"evt3", words(EvtFormat::evt3)},
      {"evt4", words(EvtFormat::evt4)},
      {"hdf5_chunk", hdf5_chunk},
      {"hdf5_filters", hdf5_filters},
      {"mask", mask},
      {"npy", decoder_of([] { return make_npy_decoder(); })},
      {"npz", npz},
      {"pixel_list", pixel_list},
      {"raw", decoder_of([] { return make_prophesee_raw_decoder(); }, 6)},
      {"recognition", recognition},
  };
  static const Parser& chosen = parsers.at(std::getenv("FORMAT"));
  return chosen;
}

}  // namespace

/// The library of HDF5 keeps half a megabyte of memory per opened file.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  constexpr int bytes = 16 << 20;
  H5set_free_list_limits(bytes, bytes, bytes, bytes, bytes, bytes);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  parser()({data, size});
  return 0;
}
