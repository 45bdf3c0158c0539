// SPDX-License-Identifier: LGPL-2.1-or-later
// Valid files of all AEDAT versions.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "src/formats/aedat/aedat4_encoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/fuzz/seed.hpp"

namespace fuzz {

inline std::vector<Seed> aedat2_seeds() {
  constexpr SensorSize davis{346, 260};
  constexpr SensorSize dvs128{128, 128};
  return {{"davis", aedat_files::aedat2_davis(few_events(1, davis, 40), davis, "Davis346blue")},
          {"dvs128", aedat_files::aedat2_dvs128(few_events(2, dvs128, 40))},
          {"v2e", aedat_files::aedat2_v2e(few_events(3, davis, 40), davis)},
          {"matlab", aedat_files::aedat2_of_matlab(few_events(4, dvs128, 40))},
          {"first", aedat_files::aedat1(few_events(5, dvs128, 40))},
          {"empty", aedat_files::aedat2_header("")}};
}

inline std::vector<Seed> aedat3_seeds() {
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

inline std::vector<Seed> aedat4_seeds() {
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

}  // namespace fuzz
