// SPDX-License-Identifier: LGPL-2.1-or-later
// Bags of ROS 1 and of ROS 2 with SQLite, written from their specifications:
// wiki.ros.org/Bags/Format/2.0, github.com/ros2/rosbag2 (rosbag2_storage_sqlite3).
#pragma once

#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera::rosbags {

using Text = std::string;

template <class Number>
Text binary(Number number) {
  return {reinterpret_cast<const char*>(&number), sizeof number};
}

inline Text sized(const Text& text) {
  return binary(static_cast<std::uint32_t>(text.size())) + text;
}

inline Text record(std::initializer_list<std::pair<const char*, Text>> fields, const Text& data) {
  Text header;
  for (const auto& [name, value] : fields) header += sized(Text(name) + "=" + value);
  return sized(header) + sized(data);
}

inline Text time(Microseconds t) {
  return binary(static_cast<std::uint32_t>(t / 1'000'000)) +
         binary(static_cast<std::uint32_t>(t % 1'000'000 * 1000));
}

inline Text event_array(SensorSize size, std::span<const AbsoluteEvent> events) {
  Text message = binary(std::uint32_t{0}) + time(events.front().t) + sized("camera") +
                 binary(size.height) + binary(size.width) +
                 binary(static_cast<std::uint32_t>(events.size()));
  for (const auto& event : events)
    message += binary(event.x) + binary(static_cast<std::uint16_t>(event.y())) + time(event.t) +
               static_cast<char>(event.polarity());
  return message;
}

/// A bag with the topic /dvs/events of dvs_msgs/EventArray: a chunk per message of up to
/// `per_message` events, and an index.
inline std::vector<std::uint8_t> of_events(SensorSize size, std::span<const AbsoluteEvent> events,
                                           std::size_t per_message) {
  const Text magic = "#ROSBAG V2.0\n";
  const Text number = binary(std::uint32_t{0});
  const Text connection = record({{"op", "\x07"}, {"conn", number}, {"topic", "/dvs/events"}},
                                 sized("topic=/dvs/events") + sized("type=dvs_msgs/EventArray") +
                                     sized("md5sum=*") + sized("message_definition="));
  constexpr std::size_t first_record = 4096;
  Text chunks;
  Text infos;
  std::uint32_t count = 0;
  for (; !events.empty(); ++count) {
    const auto some = events.first(std::min(per_message, events.size()));
    events = events.subspan(some.size());
    const auto t = time(some.back().t);
    const Text head = count == 0 ? connection : Text();
    const Text content =
        head + record({{"op", "\x02"}, {"conn", number}, {"time", t}}, event_array(size, some));
    infos +=
        record({{"op", "\x06"},
                {"ver", binary(std::uint32_t{1})},
                {"chunk_pos", binary(std::uint64_t{magic.size() + first_record + chunks.size()})},
                {"start_time", t},
                {"end_time", t},
                {"count", binary(std::uint32_t{1})}},
               number + binary(std::uint32_t{1}));
    chunks += record({{"op", "\x05"},
                      {"compression", "none"},
                      {"size", binary(static_cast<std::uint32_t>(content.size()))}},
                     content);
    chunks += record({{"op", "\x04"},
                      {"ver", binary(std::uint32_t{1})},
                      {"conn", number},
                      {"count", binary(std::uint32_t{1})}},
                     t + binary(static_cast<std::uint32_t>(head.size())));
  }
  const auto bag = [&](std::size_t padding) {
    return record(
        {{"op", "\x03"},
         {"index_pos", binary(std::uint64_t{magic.size() + first_record + chunks.size()})},
         {"conn_count", binary(std::uint32_t{1})},
         {"chunk_count", binary(count)}},
        Text(padding, ' '));
  };
  const Text file = magic + bag(first_record - bag(0).size()) + chunks + connection + infos;
  return {file.begin(), file.end()};
}

/// XCDR1, little-endian: fields at multiples of their size after the encapsulation.
class Cdr {
 public:
  template <class Number>
  void put(Number number) {
    fields_.resize((fields_.size() + sizeof number - 1) / sizeof number * sizeof number);
    fields_ += binary(number);
  }
  void text(const Text& text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    fields_ += text + '\0';
  }
  void time(Microseconds t) {
    put(static_cast<std::uint32_t>(t / 1'000'000));
    put(static_cast<std::uint32_t>(t % 1'000'000 * 1000));
  }
  Text message() const { return Text("\0\1\0\0", 4) + fields_; }

 private:
  Text fields_;
};

inline Text cdr_event_array(SensorSize size, std::span<const AbsoluteEvent> events) {
  Cdr fields;
  fields.time(events.front().t);
  fields.text("camera");
  fields.put(static_cast<std::uint32_t>(size.height));
  fields.put(static_cast<std::uint32_t>(size.width));
  fields.put(static_cast<std::uint32_t>(events.size()));
  for (const auto& event : events) {
    fields.put(event.x);
    fields.put(static_cast<std::uint16_t>(event.y()));
    fields.time(event.t);
    fields.put(static_cast<std::uint8_t>(event.polarity()));
  }
  return fields.message();
}

/// A .db3 with the topic /dvs/events of dvs_msgs/msg/EventArray: a row per message of up to
/// `per_message` events. Pages of 512 bytes are the smallest.
inline std::vector<std::uint8_t> db3_of_events(SensorSize size,
                                               std::span<const AbsoluteEvent> events,
                                               std::size_t per_message, int page_size = 4096) {
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  const auto pages = "PRAGMA page_size = " + std::to_string(page_size);
  sqlite3_exec(database, pages.c_str(), nullptr, nullptr, nullptr);
  sqlite3_exec(database,
               "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
               " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
               "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
               " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
               "INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray', 'cdr', '');"
               "BEGIN",
               nullptr, nullptr, nullptr);
  sqlite3_stmt* row = nullptr;
  sqlite3_prepare_v2(database, "INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)",
                     -1, &row, nullptr);
  while (!events.empty()) {
    const auto some = events.first(std::min(per_message, events.size()));
    events = events.subspan(some.size());
    const auto message = cdr_event_array(size, some);
    sqlite3_bind_int64(row, 1, some.back().t * 1000);
    sqlite3_bind_blob(row, 2, message.data(), static_cast<int>(message.size()), SQLITE_STATIC);
    sqlite3_step(row);
    sqlite3_reset(row);
  }
  sqlite3_finalize(row);
  sqlite3_exec(database, "COMMIT", nullptr, nullptr, nullptr);
  sqlite3_int64 count = 0;
  auto* const bytes = sqlite3_serialize(database, "main", &count, 0);
  const std::vector<std::uint8_t> file(bytes, bytes + count);
  sqlite3_free(bytes);
  sqlite3_close(database);
  return file;
}

}  // namespace eventcamera::rosbags
