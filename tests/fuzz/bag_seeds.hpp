// SPDX-License-Identifier: LGPL-2.1-or-later
// Valid bags.
#pragma once

#include <sqlite3.h>

#include <string>
#include <vector>

#include "src/formats/ros/mcap_encoder.hpp"
#include "tests/formats/rosbags.hpp"
#include "tests/fuzz/seed.hpp"

namespace fuzz {

/// A database with one topic of dvs_msgs/msg/EventArray, in small pages.
inline Seed db3_seed() {
  const auto hexadecimal = [](const std::string& bytes) {
    constexpr const char* digits = "0123456789abcdef";
    std::string text;
    for (const char c : bytes) {
      text += digits[static_cast<std::uint8_t>(c) >> 4];
      text += digits[static_cast<std::uint8_t>(c) & 15];
    }
    return text;
  };
  std::string script =
      "PRAGMA page_size = 512;"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,"
      " offered_qos_profiles TEXT);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data "
      "BLOB);"
      "INSERT INTO topics VALUES(1, '/dvs/events', 'dvs_msgs/msg/EventArray', 'cdr', '');";
  for (std::uint32_t i = 1; i < 20; ++i) {
    std::string message("\0\1\0\0", 4);
    for (const std::uint32_t number : {i, 0U, 1U, 0U, 180U, 240U, 1U, 100U << 16 | 200U, i, 5000U})
      message += rosbags::binary(number);
    message += '\1';
    script += "INSERT INTO messages VALUES(" + std::to_string(i) + ", 1, " + std::to_string(i) +
              "000000000, x'" + hexadecimal(message) + "');";
  }
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  sqlite3_exec(database, script.c_str(), nullptr, nullptr, nullptr);
  sqlite3_int64 size = 0;
  unsigned char* const bytes = sqlite3_serialize(database, "main", &size, 0);
  Seed seed{"db3", {bytes, bytes + size}};
  sqlite3_free(bytes);
  sqlite3_close(database);
  return seed;
}

inline std::vector<Seed> bag_seeds() {
  constexpr SensorSize size{346, 260};
  std::vector<Seed> seeds;
  unsigned number = 1;
  for (const auto events : {BagEvents::evt3, BagEvents::mono})
    for (const auto compression :
         {BagCompression::none, BagCompression::lz4, BagCompression::zstd}) {
      const auto encoder = make_mcap_encoder({size, events, compression});
      Seed seed{"mcap-" + std::to_string(number), {}};
      encoder->encode(few_events(number++, size, 24), seed.bytes);
      encoder->finish(seed.bytes);
      seeds.push_back(seed);
    }
  seeds.push_back({"rosbag", rosbags::of_events(size, few_events(9, size, 24), 12)});
  seeds.push_back(db3_seed());
  return seeds;
}

}  // namespace fuzz
