// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the seed corpora for fuzzing: make_corpus DIRECTORY
#include <png.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tests/formats/compressed.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/fuzz/aedat_seeds.hpp"
#include "tests/fuzz/bag_seeds.hpp"
#include "tests/fuzz/datagram_seeds.hpp"
#include "tests/fuzz/table_seeds.hpp"
#include "tests/fuzz/word_scanner_seeds.hpp"
#include "tests/wire/rtp_packets.hpp"

namespace {

using namespace fuzz;

/// Files of a format: without events, with few and with more events.
std::vector<Seed> seeds_of(const formats::Format& format) {
  constexpr SensorSize size{640, 480};
  recordings::Random random(1);
  std::vector<Seed> seeds;
  for (int i = 0; i < 20; ++i) {
    const auto events = recordings::random_events(random, size, static_cast<std::size_t>(5 * i),
                                                  i % 2 == 0 ? 1000 : 100'000);
    seeds.push_back({format.name + "-" + std::to_string(i),
                     recordings::encode(*format.make_encoder(size), events)});
  }
  return seeds;
}

/// For chunker_fuzz: evenly spaced events, interleaved with commands to return some.
std::vector<Seed> chunker_seeds() {
  std::vector<Seed> seeds;
  for (const std::uint8_t shift : {0, 4, 10}) {
    Seed seed{"pace-" + std::to_string(shift), {}};
    for (std::uint8_t i = 0; i < 24; ++i)
      seed.bytes.insert(seed.bytes.end(),
                        {shift, 9, 0, static_cast<std::uint8_t>(i % 6 < 4 ? 3 : i % 6 - 4)});
    seeds.push_back(seed);
  }
  return seeds;
}

/// For atis_fuzz: events in order, an overflow, and a wrap.
std::vector<Seed> atis_seeds() {
  Seed seed{"events", {}};
  for (std::uint8_t i = 0; i < 60; ++i) {
    const auto row = static_cast<std::uint8_t>(i == 30 ? 240 : i % 34);
    seed.bytes.insert(seed.bytes.end(), {static_cast<std::uint8_t>(7 * i % 34), row,
                                         static_cast<std::uint8_t>(i % 50 << 1 | i << 7),
                                         static_cast<std::uint8_t>(9 * i), i});
  }
  return {seed};
}

/// For tensor_fuzz: windows of each kind, and tensors of each representation, of a few intervals.
std::vector<Seed> tensor_seeds() {
  std::vector<Seed> seeds;
  for (const std::uint8_t kind : {0, 1, 2, 3}) {
    const auto by_count = static_cast<std::uint8_t>(kind == 1 ? 3 : 0);
    const auto by_time = static_cast<std::uint8_t>(kind == 2 ? 5 : 0);
    Seed seed{"kind-" + std::to_string(kind), {by_count, by_time, kind, 50, kind, kind}};
    for (std::uint8_t i = 0; i < 24; ++i)
      seed.bytes.insert(seed.bytes.end(), {static_cast<std::uint8_t>(10 * i), 1, 2, 0, i,
                                           static_cast<std::uint8_t>(i % 16), i,
                                           static_cast<std::uint8_t>(i % 6 == 5 ? 7 : 0)});
    seeds.push_back(seed);
  }
  return seeds;
}

/// For filter_fuzz: bursts of a pixel, and of its neighbours.
std::vector<Seed> filter_seeds() {
  std::vector<Seed> seeds;
  for (const std::uint8_t neighbours : {1, 3}) {
    Seed seed{"neighbours-" + std::to_string(neighbours), {}};
    for (std::uint8_t i = 0; i < 40; ++i)
      seed.bytes.insert(seed.bytes.end(),
                        {static_cast<std::uint8_t>(5 + i % neighbours),
                         static_cast<std::uint8_t>(i / 8 % 2 == 0 ? 4 : 0x84),
                         static_cast<std::uint8_t>(i % 16 == 15 ? 0xe0 : 0), 0xe8, 3, 0, 0});
    seeds.push_back(seed);
  }
  return seeds;
}

std::vector<Seed> pixel_list_seeds() {
  const std::string text = "# Hot pixels\n1 2\n\n 300, 16383\r\n";
  return {{"list", {text.begin(), text.end()}}};
}

/// For rtp_fuzz: streams of both formats.
std::vector<Seed> rtp_seeds() {
  constexpr SensorSize size{640, 480};
  std::vector<Seed> seeds;
  for (unsigned i = 0; i < 20; ++i) {
    const auto format = i % 2 == 0 ? RtpEventFormat::evt3 : RtpEventFormat::xytp;
    Seed seed{"stream-" + std::to_string(i), {static_cast<std::uint8_t>(i % 2)}};
    RtpPacker packer(size, format);
    auto intervals = rtp_packets::random_intervals(size, 3, i);
    for (auto& interval : intervals)
      interval.events.resize(std::min<std::size_t>(interval.events.size(), 5 * i));
    for (const auto& packet : rtp_packets::packets_of(intervals, packer, 100, 1)) {
      const auto length = static_cast<std::uint8_t>(packet.payload.size());
      seed.bytes.insert(seed.bytes.end(),
                        {static_cast<std::uint8_t>(packet.marker ? 1 : 0),
                         static_cast<std::uint8_t>(packet.sequence_number), 0, length});
      seed.bytes.insert(seed.bytes.end(), packet.payload.begin(), packet.payload.end());
    }
    seeds.push_back(seed);
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
  return {{"profile", {text.begin(), text.end()}}};
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
  return {{"opencv", {opencv.begin(), opencv.end()}}, {"ros", {ros.begin(), ros.end()}}};
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

/// A file of text, compressed.
std::vector<Seed> compressed_seeds() {
  constexpr std::string_view text = "t,x,y,p\n100,10,20,1\n200,11,21,0\n1300,12,22,1\n";
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  return {{"gzip", compressed::gzip(bytes)}, {"zstd", compressed::zstd(bytes)}};
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
      {"csv", csv_seeds()},       {"hdf5", hdf5_seeds()},     {"npy", npy_seeds()},
      {"npz", npz_seeds()},       {"bag", bag_seeds()}};
  for (const auto& format : formats::all()) {
    if (format.name.starts_with("evt"))
      write(corpus / format.name, seeds_of(format));
    else
      append(seeds_of(format), files[format.name.starts_with("raw_") ? "raw" : format.name]);
  }
  write(corpus / "atis", atis_seeds());
  write(corpus / "calibration", calibration_seeds());
  write(corpus / "camera_profile", camera_profile_seeds());
  write(corpus / "mask", mask_seeds());
  write(corpus / "ecf", ecf_seeds());
  write(corpus / "hdf5_chunk", hdf5_chunk_seeds());
  write(corpus / "hdf5_filters", hdf5_filters_seeds());
  write(corpus / "chunker", chunker_seeds());
  write(corpus / "compressed", compressed_seeds());
  write(corpus / "datagram", datagram_seeds());
  write(corpus / "filter", filter_seeds());
  write(corpus / "pixel_list", pixel_list_seeds());
  write(corpus / "rtp", rtp_seeds());
  write(corpus / "tensor", tensor_seeds());
  write(corpus / "word_scanner", word_scanner_seeds());

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
