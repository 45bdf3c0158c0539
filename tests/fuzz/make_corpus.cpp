// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the seed corpora for fuzzing: make_corpus DIRECTORY
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/ros/mcap_encoder.hpp"
#include "src/formats/text/csv_encoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/compressed.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/npz_file.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/wire/datagrams.hpp"
#include "tests/wire/rtp_packets.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::bytes_of;

struct Seed {
  std::string name;
  std::vector<std::uint8_t> bytes;
};

recordings::Events few_events(unsigned seed, SensorSize size, std::size_t count) {
  return recordings::random_events(size, count, seed, 0, 3'600'000'000);
}

void add(Seed& seed, std::initializer_list<int> bytes) {
  for (const int byte : bytes) seed.bytes.push_back(static_cast<std::uint8_t>(byte));
}

void add(Seed& seed, std::span<const std::uint8_t> bytes) {
  seed.bytes.insert(seed.bytes.end(), bytes.begin(), bytes.end());
}

Seed seed_of(std::string_view name, std::string_view text) {
  return {std::string(name), recordings::bytes_of(text)};
}

/// Files of a format: without events, with few and with more events.
std::vector<Seed> seeds_of(const formats::Format& format) {
  constexpr SensorSize size{640, 480};
  std::vector<Seed> seeds;
  for (unsigned i = 0; i < 20; ++i) {
    const auto events =
        recordings::random_events(size, std::size_t{5} * i, i, 0, i % 2 == 0 ? 1000 : 100'000);
    seeds.push_back({format.name + "-" + std::to_string(i),
                     recordings::encode(*format.make_encoder(size), events)});
  }
  return seeds;
}

std::vector<Seed> aedat2_seeds() {
  constexpr SensorSize davis{346, 260};
  constexpr SensorSize dvs128{128, 128};
  return {{"davis", aedat_files::aedat2_davis(few_events(1, davis, 40), davis, "Davis346blue")},
          {"dvs128", aedat_files::aedat2_dvs128(few_events(2, dvs128, 40))},
          {"v2e", aedat_files::aedat2_v2e(few_events(3, davis, 40), davis)},
          {"matlab", aedat_files::aedat2_of_matlab(few_events(4, dvs128, 40))},
          {"first", aedat_files::aedat1(few_events(5, dvs128, 40))},
          {"empty", aedat_files::aedat2_header("")}};
}

std::vector<Seed> aedat3_seeds() {
  auto mixed = aedat_files::aedat3_header("DVS128");
  aedat_files::add_aedat3_packet_header(mixed, 0, 8, 1, 2);
  for (const int type : {2, 3}) {
    aedat_files::add_little(mixed, type << 1 | 1, 4);
    aedat_files::add_little(mixed, 100 + type, 4);
  }
  aedat_files::add_aedat3_packet_header(mixed, 3, 36, 0, 1);
  mixed.resize(mixed.size() + 36, 1);
  return {{"davis", aedat_files::aedat3(few_events(1, {346, 260}, 30), "DAVIS346", 10)},
          {"other", aedat_files::aedat3(few_events(2, {500, 400}, 30), "other", 10)},
          {"mixed", mixed}};
}

std::vector<Seed> aedat4_seeds() {
  constexpr SensorSize size{346, 260};
  const auto events = few_events(1, size, 16);
  const std::array<std::uint8_t, 48> pixels{1, 2, 3};
  const std::array<Trigger, 2> edges{{{1000, 0, true}, {1001, 3, false}}};
  const std::array<ImuSample, 2> samples{
      {{1000, 40, {0, -1, 0}, {1, 2, 3}, {}}, {2000, 40, {0, -1, 0}, {3, 2, 1}, {}}}};
  std::vector<Seed> seeds;
  for (const auto compression :
       {Aedat4Compression::none, Aedat4Compression::lz4, Aedat4Compression::zstd}) {
    Aedat4Encoder encoder({size, "seed", compression, true, true, true, true});
    std::vector<std::uint8_t> bytes;
    encoder.encode(std::span<const Trigger>(edges), bytes);
    encoder.encode(std::span<const ImuSample>(samples), bytes);
    encoder.encode(std::span(events).first(10), bytes);
    encoder.encode({1500, 0, 0, 0, 0, PixelFormat::bgr, 4, 4, 0, 0, pixels.data(), 12}, bytes);
    encoder.encode(std::span(events).subspan(10), bytes);
    encoder.finish(bytes);
    const auto name = std::to_string(static_cast<int>(compression));
    seeds.push_back({"unfinished-" + name, bytes});
    const auto patch = encoder.patch().value();
    std::copy(patch.bytes.begin(), patch.bytes.end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(patch.position));
    seeds.push_back({"compression-" + name, bytes});
  }
  auto unlisted = aedat_files::aedat4_header("");
  aedat_files::add_packet(unlisted, 0, aedat_files::events_content(events));
  const std::array<aedat_files::TriggerSource, 2> triggers{{{1000, 1}, {1001, 2}}};
  aedat_files::add_packet(unlisted, 1, aedat_files::triggers_content(triggers));
  seeds.push_back({"unlisted", unlisted});
  return seeds;
}

std::vector<Seed> csv_seeds() {
  std::vector<Seed> seeds;
  for (const auto& [name, description, format] : csv_formats()) {
    const auto encoder = make_csv_encoder(format, {640, 480});
    seeds.push_back(
        {std::string(name), recordings::encode(*encoder, few_events(1, {640, 480}, 20))});
  }
  seeds.push_back({"index", bytes_of(",t_ns,x,y,p\n0,1500,3,4,1\n1,2500,5,6,0\n")});
  seeds.push_back(
      {"floats", bytes_of("1.0e+01 3.0e+00 4.0e+00 1.0e+00\n1.2e+01 5.0e+00 6.0e+00 0.0e+00\n")});
  seeds.push_back(
      {"other", bytes_of("# a comment\n\"X\"; Y ;Pol;time [s]\r\n1;2;true;1e-3\n3;4;-1;.5\n"
                         "1.0e0;2.00;false;0.0010005\n\n7;8\n")});
  return seeds;
}

std::vector<Seed> npy_seeds() {
  NpyEncoder encoder;
  const auto ours = recordings::encode(encoder, few_events(1, {640, 480}, 20));
  auto other = bytes_of(std::string("\x93NUMPY\x02\x00\xa0\x00\x00\x00", 12) +
                        "{'descr': [('p', '|b1'), ('', '|V3'), (('a', 't'), '>f8'), ('x', '<f2'), "
                        "('y', '>i4', ), ('z', '<u2', (2, 3))], 'fortran_order': False, "
                        "'shape': (3,), }");
  other.resize(12 + 0xa0, ' ');
  other.resize(other.size() + 3 * 30, 0x3c);
  const std::vector<double> numbers = {0.5, 3, 4, 1, 0.75, 5, 6, 0};
  return {{"ours", ours}, {"other", other}, {"rows", npz_file::array("'<f8'", "(2, 4)", numbers)}};
}

std::vector<Seed> npz_seeds() {
  const SensorSize size = {640, 480};
  std::vector<Seed> seeds = {
      {"ours", recordings::encode(*make_npz_encoder(size), few_events(1, size, 20))}};
  const auto rows = npy_seeds().back().bytes;
  for (const bool is_compressed : {false, true}) {
    const std::string how = is_compressed ? "-packed" : "-stored";
    seeds.push_back({"columns" + how,
                     npz_file::archive({{"t_ns.npy", npz_file::column<double>("<f8", {10, 20})},
                                        {"x.npy", npz_file::column<std::uint16_t>("<u2", {1, 2})},
                                        {"y.npy", npz_file::column<std::int32_t>("<i4", {3, 4})},
                                        {"p.npy", npz_file::column<std::uint8_t>("|b1", {0, 1})}},
                                       is_compressed)});
    seeds.push_back({"rows" + how, npz_file::archive({{"arr_0.npy", rows}}, is_compressed)});
  }
  return seeds;
}

std::vector<Seed> ecf_seeds() {
  std::vector<Seed> seeds;
  for (const SensorSize size : {SensorSize{2, 3}, {128, 128}, {640, 480}, {2048, 2048}}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      Bytes chunk;
      encode_ecf(few_events(seed, size, std::size_t{40} * seed), chunk);
      seeds.push_back({std::to_string(size.width) + "-" + std::to_string(seed), chunk});
    }
  }
  return seeds;
}

Bytes deflated(const Bytes& bytes) {
  Bytes packed(compressBound(bytes.size()));
  auto size = static_cast<uLongf>(packed.size());
  compress(packed.data(), &size, bytes.data(), bytes.size());
  packed.resize(size);
  return packed;
}

/// For chunks of HDF5: layout, filters, and the bytes of a chunk.
std::vector<Seed> hdf5_chunk_seeds() {
  auto seeds = ecf_seeds();
  for (auto& seed : seeds) seed.bytes.insert(seed.bytes.begin(), {2, 0, 200, 250, 0});
  for (const std::uint8_t layout : {0, 1, 3}) {
    for (const std::uint8_t filters : {0, 1, 2, 3}) {
      Bytes bytes = {layout, filters, 16, 30, 0};
      Bytes rows(std::size_t{16} * (layout == 0 ? 4 : 16), 1);
      if ((filters & 1) != 0) rows = deflated(rows);
      bytes.insert(bytes.end(), rows.begin(), rows.end());
      seeds.push_back({"other-" + std::to_string(layout) + "-" + std::to_string(filters), bytes});
    }
  }
  return seeds;
}

/// For the filters of HDF5: filters, those that are not applied, and 16 numbers of 4 bytes.
std::vector<Seed> hdf5_filters_seeds() {
  const Bytes numbers(64, 1);
  Bytes shuffled = {1, 1, 1, 6, 3};
  shuffled.insert(shuffled.end(), numbers.begin(), numbers.end());
  Bytes packed = {1, 0, 2, 4, 3};
  const auto bytes = deflated(numbers);
  packed.insert(packed.end(), bytes.begin(), bytes.end());
  return {{"empty", {1, 1, 1, 6, 3}}, {"shuffled", shuffled}, {"packed", packed}};
}

/// For bags; tests/fuzz/run adds those of other programs.
std::vector<Seed> bag_seeds() {
  constexpr SensorSize size{346, 260};
  const auto events = few_events(1, size, 24);
  std::vector<Seed> seeds;
  for (const auto kind : {BagEvents::evt3, BagEvents::mono})
    for (const auto compression : {BagCompression::none, BagCompression::lz4, BagCompression::zstd})
      seeds.push_back({"mcap-" + std::to_string(seeds.size()),
                       recordings::encode(*make_mcap_encoder({size, kind, compression}), events)});
  return seeds;
}

/// For chunker_fuzz: evenly spaced events, interleaved with commands to return some.
std::vector<Seed> chunker_seeds() {
  std::vector<Seed> seeds;
  for (const int shift : {0, 4, 10}) {
    auto& seed = seeds.emplace_back(seed_of("pace-" + std::to_string(shift), ""));
    for (int i = 0; i < 24; ++i) add(seed, {shift, 9, 0, i % 6 < 4 ? 3 : i % 6 - 4});
  }
  return seeds;
}

/// For the parser of N-MNIST: events in order, an overflow, and a wrap.
std::vector<Seed> atis_seeds() {
  Seed seed{"events", {}};
  for (int i = 0; i < 60; ++i)
    add(seed, {7 * i % 34, i == 30 ? 240 : i % 34, i % 50 << 1 | i << 7, 9 * i, i});
  return {seed};
}

/// For tensor_fuzz: windows of each kind, and tensors of each representation, of a few intervals.
std::vector<Seed> tensor_seeds() {
  std::vector<Seed> seeds;
  for (const int kind : {0, 1, 2, 3}) {
    auto& seed = seeds.emplace_back(seed_of("kind-" + std::to_string(kind), ""));
    add(seed, {kind == 1 ? 3 : 0, kind == 2 ? 5 : 0, kind, 50, kind, kind});
    for (int i = 0; i < 24; ++i) add(seed, {10 * i, 1, 2, 0, i, i % 16, i, i % 6 == 5 ? 7 : 0});
  }
  return seeds;
}

/// For filter_fuzz: bursts of a pixel, and of its neighbours.
std::vector<Seed> filter_seeds() {
  std::vector<Seed> seeds;
  for (const int neighbours : {1, 3}) {
    auto& seed = seeds.emplace_back(seed_of("neighbours-" + std::to_string(neighbours), ""));
    for (int i = 0; i < 40; ++i)
      add(seed,
          {5 + i % neighbours, i / 8 % 2 == 0 ? 4 : 0x84, i % 16 == 15 ? 0xe0 : 0, 0xe8, 3, 0, 0});
  }
  return seeds;
}

/// For datagram_fuzz: streams of small datagrams in every format.
std::vector<Seed> datagram_seeds() {
  std::vector<Seed> seeds;
  const auto formats = datagrams::all();
  for (std::size_t i = 0; i < formats.size(); ++i) {
    for (unsigned count = 1; count < 30; count += 7) {
      auto& seed = seeds.emplace_back(seed_of(formats[i].name + "-" + std::to_string(count), ""));
      add(seed, {static_cast<int>(i)});
      for (const auto& packet :
           datagrams::packets_of(formats[i].settings, few_events(count, {640, 480}, count))) {
        const auto size = static_cast<int>(packet.bytes.size());
        add(seed, {size, size >> 8, 20});
        add(seed, packet.bytes);
      }
    }
  }
  return seeds;
}

/// For word_scanner_fuzz: words of every format, in transfers and in pieces, one of which is lost.
std::vector<Seed> word_scanner_seeds() {
  constexpr SensorSize sensor{320, 240};
  std::vector<Seed> seeds;
  for (int kind = 0; kind < 10; ++kind) {
    auto& seed = seeds.emplace_back(seed_of("kind-" + std::to_string(kind), ""));
    add(seed, {kind});
    const auto encoder = make_evt_encoder(static_cast<EvtFormat>(kind % 5), sensor);
    const auto words = recordings::encode(
        *encoder, recordings::random_events(sensor, 60, static_cast<unsigned>(kind), 0, 1000));
    int number = 0;
    for (const auto transfer : recordings::pieces_of(words, 60)) {
      if (++number == 4 || seed.bytes.size() >= 400) continue;
      add(seed, {static_cast<int>(transfer.size()), 0, number});
      add(seed, transfer);
    }
  }
  return seeds;
}

std::vector<Seed> pixel_list_seeds() {
  return {seed_of("list", "# Hot pixels\n1 2\n\n 300, 16383\r\n")};
}

std::vector<Seed> rtp_seeds() {
  constexpr SensorSize size{640, 480};
  std::vector<Seed> seeds;
  for (unsigned i = 0; i < 20; ++i) {
    const auto format = i % 2 == 0 ? RtpEventFormat::evt3 : RtpEventFormat::xytp;
    auto& seed = seeds.emplace_back(seed_of("stream-" + std::to_string(i), ""));
    add(seed, {static_cast<int>(i % 2)});
    RtpPacker packer(size, format);
    auto intervals = rtp_packets::random_intervals(size, 3, i);
    for (auto& interval : intervals)
      interval.events.resize(std::min<std::size_t>(interval.events.size(), 5 * i));
    for (const auto& packet : rtp_packets::packets_of(intervals, packer, 100, 1)) {
      add(seed, {packet.marker ? 1 : 0, packet.sequence_number, 0,
                 static_cast<int>(packet.payload.size())});
      add(seed, packet.payload);
    }
  }
  return seeds;
}

void append(const std::vector<Seed>& more, std::vector<Seed>& seeds) {
  seeds.insert(seeds.end(), more.begin(), more.end());
}

void write(const std::filesystem::path& directory, const std::vector<Seed>& seeds) {
  std::filesystem::create_directories(directory);
  for (const auto& [name, bytes] : seeds) {
    std::ofstream file(directory / name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
}

std::vector<Seed> camera_profile_seeds() {
  constexpr std::string_view text =
      "# of a camera\n[eventsim-dvs]\nresponse=log\nlog-eps=0.057\nname=a\\tb\n[other]\nx=1;2\n";
  return {seed_of("profile", text)};
}

std::vector<Seed> calibration_seeds() {
  constexpr std::string_view opencv =
      "%YAML:1.0\n---\nimage_width: 6\nimage_height: 4\ncamera_matrix: !!opencv-matrix\n   rows: "
      "3\n"
      "   cols: 3\n   dt: d\n   data: [ 5., 0., 3., 0., 5., 2., 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
      "   data: [ -2.1e-01, 0.1, 0., 1.e-03, 0. ]\n";
  constexpr std::string_view ros =
      "camera_matrix:\n  data: [5, 0, 3, 0, 5, 2, 0, 0, 1]\ndistortion_model: equidistant\n"
      "distortion_coefficients:\n  data: [0.1, 0.01, 0, 0]\n";
  return {seed_of("opencv", opencv), seed_of("ros", ros)};
}

/// Pictures of 8 x 4 pixels, in grey and with transparency.
std::vector<Seed> mask_seeds() {
  std::vector<Seed> seeds;
  for (const unsigned format : {unsigned{PNG_FORMAT_GRAY}, unsigned{PNG_FORMAT_RGBA}}) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = 8;
    image.height = 4;
    image.format = format;
    const std::vector<png_byte> pixels(PNG_IMAGE_SIZE(image), 200);
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    Seed seed{"picture-" + std::to_string(format), std::vector<std::uint8_t>(size)};
    png_image_write_to_memory(&image, seed.bytes.data(), &size, 0, pixels.data(), 0, nullptr);
    seed.bytes.resize(size);
    seeds.push_back(std::move(seed));
  }
  return seeds;
}

std::vector<Seed> compressed_seeds() {
  const auto text = recordings::bytes_of("t,x,y,p\n100,10,20,1\n200,11,21,0\n1300,12,22,1\n");
  return {{"gzip", compressed::gzip(text)}, {"zstd", compressed::zstd(text)}};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "make_corpus DIRECTORY\n");
    return 2;
  }
  const std::filesystem::path corpus = argv[1];
  std::map<std::string, std::vector<Seed>> files = {
      {"aedat2", aedat2_seeds()}, {"aedat3", aedat3_seeds()}, {"aedat4", aedat4_seeds()},
      {"csv", csv_seeds()},       {"npy", npy_seeds()},       {"npz", npz_seeds()},
      {"bag", bag_seeds()}};
  std::map<std::string, std::vector<Seed>> others = {{"atis", atis_seeds()},
                                                     {"calibration", calibration_seeds()},
                                                     {"camera_profile", camera_profile_seeds()},
                                                     {"chunker", chunker_seeds()},
                                                     {"compressed", compressed_seeds()},
                                                     {"datagram", datagram_seeds()},
                                                     {"ecf", ecf_seeds()},
                                                     {"filter", filter_seeds()},
                                                     {"hdf5_chunk", hdf5_chunk_seeds()},
                                                     {"hdf5_filters", hdf5_filters_seeds()},
                                                     {"mask", mask_seeds()},
                                                     {"pixel_list", pixel_list_seeds()},
                                                     {"rtp", rtp_seeds()},
                                                     {"tensor", tensor_seeds()},
                                                     {"word_scanner", word_scanner_seeds()}};
  for (const auto& format : formats::all()) {
    auto& seeds = format.name.starts_with("evt")    ? others[format.name]
                  : format.name.starts_with("raw_") ? files["raw"]
                                                    : files[format.name];
    append(seeds_of(format), seeds);
  }
  for (const auto& [target, seeds] : others) write(corpus / target, seeds);

  // Typefinders may see any of them.
  std::vector<Seed> all;
  for (auto& [target, seeds] : files) {
    write(corpus / target, seeds);
    for (auto& seed : seeds) seed.name = target + "-" + seed.name;
    append(seeds, all);
  }
  Seed user_block{"user_block", std::vector<std::uint8_t>(512)};
  user_block.bytes.insert(user_block.bytes.end(), {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'});
  all.push_back(user_block);
  write(corpus / "recognition", all);
}
