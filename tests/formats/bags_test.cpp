// SPDX-License-Identifier: LGPL-2.1-or-later
// Bags of ROS: files that a script writes from the specifications have the events and frames that
// it says; written files are read back equal; seeks are exact; corrupt and cut files lose only the
// corrupt parts.
#include <gtest/gtest.h>

#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "src/core/byte_order.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/ros/mcap_encoder.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::decode;

/// Time of a frame, and the value of its first and its last pixel.
using TimedValue = std::pair<Microseconds, std::uint8_t>;

std::vector<TimedValue> values_of(const std::vector<recordings::Picture>& pictures) {
  std::vector<TimedValue> values;
  for (const auto& [frame, pixels] : pictures) {
    const auto* const first = pixels.data() + (frame.format == PixelFormat::bgr ? 2 : 0);
    const auto* const last = first + (frame.height - 1) * frame.stride +
                             (frame.width - 1) * bytes_per_pixel(frame.format);
    EXPECT_EQ(*first, *last);
    values.emplace_back(frame.t, *last);
  }
  return values;
}

/// What the decoder says of a bag that it cannot read, which must take less than a second.
std::string refusal_of(const Bytes& bytes, const std::string& topics = "") {
  const auto start = std::chrono::steady_clock::now();
  std::string refusal;
  MemoryBytes source(bytes);
  const auto decoder = make_bag_decoder(topics);
  try {
    const bool reads_itself = decoder->open(source);
    decode(*decoder, reads_itself ? std::span<const std::uint8_t>() : bytes);
  } catch (const UnsupportedFormat& error) {
    refusal = error.what();
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
  return refusal;
}

Bytes bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The files of bag_files.py.
class Bags : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::filesystem::temp_directory_path() / ("bags-" + std::to_string(getpid()));
    std::filesystem::create_directory(folder);
    const auto command =
        std::string("/usr/bin/python3 '" BAG_FILES "' '") + folder.string() + "' many";
    ASSERT_EQ(std::system(command.c_str()), 0);  // NOLINT(cert-env33-c)
    std::ifstream event_lines(folder / "events.lines");
    Microseconds t = 0;
    for (int x = 0, y = 0, p = 0; event_lines >> t >> x >> y >> p;)
      events.push_back(AbsoluteEvent::at(x, y, t, static_cast<Polarity>(p)));
    std::ifstream frame_lines(folder / "frames.lines");
    for (int value = 0; frame_lines >> t >> value;)
      frames.emplace_back(t, static_cast<std::uint8_t>(value));
    ASSERT_EQ(events.size(), 6000U);
  }

  static void TearDownTestSuite() { std::filesystem::remove_all(folder); }

  static std::vector<std::string> names() {
    std::vector<std::string> found;
    for (const auto& file : std::filesystem::directory_iterator(folder))
      if (file.path().extension() != ".lines" && file.path().stem() != "many")
        found.push_back(file.path().filename());
    return found;
  }

  static inline std::filesystem::path folder;
  static inline recordings::Events events;
  static inline std::vector<TimedValue> frames;
};

TEST_F(Bags, HaveTheirEventsAndFrames) {
  ASSERT_GE(names().size(), 12U);
  for (const auto& name : names()) {
    SCOPED_TRACE(name);
    const auto bytes = bytes_of(folder / name);
    for (const bool pulled : {false, true}) {
      MemoryBytes source(bytes);
      const auto decoder = make_bag_decoder("");
      if (pulled) decoder->open(source);
      const auto contents = decode(*decoder, bytes, pulled ? bytes.size() : 77'777);
      EXPECT_EQ(contents.events, events);
      EXPECT_EQ(values_of(contents.pictures), frames);
      EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
      ASSERT_EQ(decoder->streams().size(), 2U);
      for (const auto& stream : decoder->streams())
        EXPECT_EQ(stream.size, stream.kind == StreamKind::events ? (SensorSize{346, 260})
                                                                 : (SensorSize{86, 65}));
      EXPECT_EQ(decoder->unread_streams().names, "topics /second/events");
    }
  }
}

TEST_F(Bags, SayInTheirIndexWhereTopicsBegin) {
  for (const auto& name : names()) {
    SCOPED_TRACE(name);
    const auto bytes = bytes_of(folder / name);
    MemoryBytes source(bytes);
    const auto decoder = make_bag_decoder("");
    const bool reads_itself = decoder->open(source);
    const bool has_index = name.find("-no-") == std::string::npos;
    EXPECT_EQ(decoder->knows_all_streams(), has_index);
    ASSERT_TRUE(!has_index || decoder->streams().size() == 2U);
    for (std::size_t i = 0; i < decoder->streams().size(); ++i) {
      const auto first = decoder->first_of(i);
      ASSERT_EQ(first.has_value(), has_index);
      if (!first) continue;
      decoder->restart(*first);
      if (!reads_itself)
        decoder->push(std::span(bytes).subspan(static_cast<std::size_t>(first->position)));
      std::optional<Microseconds> t;
      while (const auto item = t ? std::nullopt : decoder->next()) {
        const auto* const some = std::get_if<EventItem>(&*item);
        const auto* const picture = std::get_if<FrameItem>(&*item);
        if (some != nullptr && some->stream == i) t = some->events.front().t;
        if (picture != nullptr && picture->stream == i) t = picture->frame.t;
      }
      const bool of_events = decoder->streams()[i].kind == StreamKind::events;
      EXPECT_EQ(t, of_events ? events.front().t : frames.front().first);
    }
  }
}

TEST_F(Bags, HaveTheTopicsThatAreChosen) {
  const auto bytes = bytes_of(folder / "evt3-lz4.mcap");
  for (const auto& [topics, count] :
       {std::pair{"/second/events", 39U}, {"/camera/events, /second/events", 6039U}}) {
    const auto decoder = make_bag_decoder(topics);
    const auto contents = decode(*decoder, bytes);
    EXPECT_EQ(contents.events.size(), count);
    EXPECT_TRUE(contents.pictures.empty());
    EXPECT_EQ(decoder->streams().size(), count == 39U ? 1U : 2U);
  }
  const auto refusal = refusal_of(bytes, "/none");
  EXPECT_NE(refusal.find("/none"), std::string::npos);
  EXPECT_NE(refusal.find("/camera/events"), std::string::npos);
}

/// Refers to the first page below each inner page of a table, again and again.
void repeat_first_pages(Bytes& database) {
  const auto big_endian = [&](std::size_t at, int size) {
    std::size_t number = 0;
    for (int i = 0; i < size; ++i) number = number << 8 | database[at++];
    return number;
  };
  const auto page_size = big_endian(16, 2);
  for (auto page = page_size; page < database.size(); page += page_size) {
    constexpr int inner_page = 5;
    if (database[page] != inner_page) continue;
    const auto child_at = [&](std::size_t i) { return page + big_endian(page + 12 + 2 * i, 2); };
    const auto first = child_at(0);
    for (std::size_t i = 1; i < big_endian(page + 3, 2); ++i)
      std::copy_n(&database[first], 4, &database[child_at(i)]);
    std::copy_n(&database[first], 4, &database[page + 8]);
  }
}

TEST_F(Bags, EndWherePagesOfADatabaseRepeat) {
  auto bytes = bytes_of(folder / "evt3.db3");
  repeat_first_pages(bytes);
  MemoryBytes source(bytes);
  const auto decoder = make_bag_decoder("");
  decoder->open(source);
  const auto contents = decode(*decoder, bytes);
  EXPECT_GT(contents.events.size(), 0U);
  EXPECT_LT(contents.events.size(), events.size() / 2);
  EXPECT_EQ(decoder->corruption().places, 1U);
}

TEST_F(Bags, StateNoLastTimeOfASourceThatIsStopped) {
  for (const auto& name : names()) {
    SCOPED_TRACE(name);
    const auto bytes = bytes_of(folder / name);
    recordings::BreakableBytes source(bytes);
    const auto decoder = make_bag_decoder("");
    decoder->open(source);
    decode(*decoder, bytes);
    source.is_broken = true;
    EXPECT_EQ(decoder->last_time(), std::nullopt);
  }
}

/// Events that are in both, of sorted ones without two alike.
std::size_t common(const std::vector<AbsoluteEvent>& a, const std::vector<AbsoluteEvent>& b) {
  std::size_t count = 0;
  auto at = a.begin();
  for (const auto& event : b) {
    const auto found = std::find(at, a.end(), event);
    if (found == a.end()) continue;
    at = found + 1;
    ++count;
  }
  return count;
}

TEST_F(Bags, LoseOnlyWhatIsCutOffOrCorrupt) {
  for (const auto& name : names()) {
    if (name.ends_with(".db3")) continue;
    SCOPED_TRACE(name);
    const auto bytes = bytes_of(folder / name);
    auto cut = bytes;
    cut.resize(cut.size() / 2);
    for (const bool pulled : {false, true}) {
      MemoryBytes source(cut);
      const auto decoder = make_bag_decoder("");
      if (pulled) decoder->open(source);
      const auto contents = decode(*decoder, cut);
      EXPECT_GT(contents.events.size(), 2000U);
      EXPECT_TRUE(
          std::ranges::equal(contents.events, std::span(events).first(contents.events.size())));
      EXPECT_EQ(decoder->corruption().places, 1U);
    }
    auto corrupt = bytes;
    std::ranges::fill(std::span(corrupt).subspan(corrupt.size() / 3, 500), 0xa5);
    const auto decoder = make_bag_decoder("");
    EXPECT_GT(common(events, decode(*decoder, corrupt).events), 4000U);
    // Bags of ROS 1 have no checksums.
    const bool has_checksums =
        name.ends_with(".mcap") && name.find("-no-chunks") == std::string::npos;
    EXPECT_GE(decoder->corruption().places, has_checksums ? 1U : 0U);
    EXPECT_LE(decoder->corruption().places, 100U);
  }
}

TEST_F(Bags, OfDatabasesSurviveCorruptPages) {
  const auto bytes = bytes_of(folder / "evt3.db3");
  std::size_t noticed = 0;
  for (std::size_t i = 0; i < 40; ++i) {
    auto corrupt = bytes;
    const auto at = i * bytes.size() / 40;
    std::ranges::fill(std::span(corrupt).subspan(at, std::min<std::size_t>(700, bytes.size() - at)),
                      static_cast<std::uint8_t>(i * 37));
    if (i % 4 == 0) corrupt.resize(bytes.size() - at);
    MemoryBytes source(corrupt);
    const auto decoder = make_bag_decoder("");
    try {
      decoder->open(source);
      EXPECT_LE(decode(*decoder, {}).events.size(), events.size());
      noticed += decoder->corruption().places > 0 ? 1 : 0;
    } catch (const UnsupportedFormat&) {
      ++noticed;
    }
  }
  EXPECT_GT(noticed, 10U);
}

/// SQLite counts its steps from the first row of a query.
TEST_F(Bags, OfManyMessagesAreReadWhole) {
  MemoryBytes source(bytes_of(folder / "many.db3"));
  const auto decoder = make_bag_decoder("");
  decoder->open(source);
  EXPECT_EQ(decode(*decoder, {}).events.size(), 200'000U);
  EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
}

/// A database made by statements of SQL.
Bytes database_of(const std::string& statements) {
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  char* error = nullptr;
  sqlite3_exec(database, ("PRAGMA page_size = 512;" + statements).c_str(), nullptr, nullptr,
               &error);
  EXPECT_EQ(error, nullptr) << error;
  sqlite3_int64 count = 0;
  auto* const bytes = sqlite3_serialize(database, "main", &count, 0);
  Bytes file(bytes, bytes + count);
  sqlite3_free(bytes);
  sqlite3_close(database);
  return file;
}

const std::string topics_table =
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
    "INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray', 'cdr');";

TEST(Databases, RunNoFunctions) {
  const std::string columns = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data";
  const std::string stored = topics_table + "CREATE TABLE stored(" + columns +
                             "); INSERT INTO stored VALUES (1, 1, 1, x'00');";
  const std::string tables[] = {
      topics_table + "CREATE TABLE messages(" + columns +
          " AS (0)); INSERT INTO messages VALUES (1, 1, 1);",
      topics_table +
          "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id AS (0),"
          " timestamp INTEGER, data); INSERT INTO messages VALUES (1, 1, x'00');",
      topics_table + "CREATE TABLE messages(" + columns + ", other AS (0));",
      stored + "CREATE VIEW messages AS SELECT id, topic_id, timestamp, (0) AS data FROM stored;",
      // a view that is listed as a table
      stored +
          "CREATE VIEW messages AS SELECT * FROM stored; PRAGMA writable_schema = 1;"
          "UPDATE sqlite_schema SET type = 'table', rootpage = 3 WHERE name = 'messages';",
      topics_table + "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data);",
      "CREATE TABLE messages(" + columns + "); CREATE VIEW topics AS SELECT 1 AS id;",
  };
  // SQLite computes generated columns of rows that are inserted, so it gets the function last.
  const std::string slow =
      "PRAGMA writable_schema = 1; UPDATE sqlite_schema SET sql = replace(sql, '(0)',"
      " '(instr(hex(zeroblob(5000000)), hex(zeroblob(2500000)) || ''1''))');";
  for (const auto& statements : tables) {
    SCOPED_TRACE(statements);
    EXPECT_NE(refusal_of(database_of(statements + slow)).find("no ordinary tables"),
              std::string::npos);
  }
}

/// Each of 16 pages refers to the next 60 times, which makes 60^16 rows.
TEST(Databases, WithPagesInCirclesEnd) {
  auto bytes =
      database_of(topics_table +
                  "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data);"
                  "INSERT INTO messages VALUES (1, 1, 1, zeroblob(20000));");
  constexpr std::size_t page_size = 512;
  constexpr std::uint8_t cells = 60;
  const auto leaf = bytes.size() / page_size - 1;
  std::copy_n(&bytes[page_size], page_size, &bytes[leaf * page_size]);  // of topics
  for (std::size_t page = 1; page <= 16; ++page) {
    const auto next = static_cast<std::uint8_t>(page == 16 ? leaf + 1 : page + 3);
    const std::size_t at = (page == 1 ? page : page + 1) * page_size;  // page 3 is of messages
    std::fill_n(&bytes[at], page_size, std::uint8_t{0});
    bytes[at] = 5;
    bytes[at + 4] = cells;
    bytes[at + 5] = 1;
    bytes[at + 11] = next;
    for (std::size_t cell = 0; cell < cells; ++cell) bytes[at + 12 + 2 * cell] = 1;
    for (std::size_t cell = 0; cell < cells; ++cell) bytes[at + 13 + 2 * cell] = 0xf0;
    bytes[at + 0x1f0 + 3] = next;
    bytes[at + 0x1f0 + 4] = 1;
  }
  EXPECT_EQ(refusal_of(bytes), "");
}

TEST_F(Bags, HaveTheSensorSizeOfTheirFirstPacket) {
  auto bytes = bytes_of(folder / "evt3-no-chunks.mcap");
  const std::uint32_t size[] = {260, 346};
  const std::span<const std::uint8_t> stated(reinterpret_cast<const std::uint8_t*>(size),
                                             sizeof size);
  const auto found = std::search(bytes.begin(), bytes.end(), stated.begin(), stated.end());
  ASSERT_NE(found, bytes.end());
  std::fill_n(found, stated.size(), std::uint8_t{0});
  const auto decoder = make_bag_decoder("/camera/events");
  EXPECT_EQ(decode(*decoder, bytes).events, events);
  EXPECT_EQ(decoder->streams().front().size, SensorSize{});
}

TEST_F(Bags, KeepNoOverlongNames) {
  const std::string name(2000, 'a');
  const auto number = [](std::uint64_t value, std::size_t size) {
    std::string bytes(size, '\0');
    std::memcpy(bytes.data(), &value, size);
    return bytes;
  };
  const auto sized = [&](const std::string& text) { return number(text.size(), 4) + text; };
  const auto mcap_record = [&](char opcode, const std::string& content) {
    return opcode + number(content.size(), 8) + content;
  };
  const auto id = number(999, 2);
  const auto records = mcap_record(3, id + sized(name)) +
                       mcap_record(4, id + id + sized(name) + sized("cdr") + sized(""));
  auto bytes = bytes_of(folder / "evt3-no-chunks.mcap");
  bytes.insert(bytes.begin() + 8, records.begin(), records.end());
  const auto decoder = make_bag_decoder("");
  EXPECT_EQ(decode(*decoder, bytes).events, events);
  EXPECT_EQ(decoder->corruption().places, 2U);
  EXPECT_EQ(refusal_of(bytes, "/none").find(name), std::string::npos);
}

TEST_F(Bags, AreRefusedWithAReason) {
  for (const auto& bytes : {Bytes(), Bytes(100, 'x')})
    EXPECT_EQ(refusal_of(bytes), "this is not a ROS bag");
  auto other = bytes_of(folder / "evt3-no-chunks.mcap");
  constexpr std::string_view encoding("evt3");
  for (auto at = other.begin();;) {
    at = std::search(at, other.end(), encoding.begin(), encoding.end());
    if (at == other.end()) break;
    std::copy_n("evt9", 4, at);
  }
  EXPECT_NE(refusal_of(other).find("\"evt9\""), std::string::npos);
}

Bytes encoded(const McapSettings& settings, std::span<const AbsoluteEvent> events,
              std::size_t piece = 1000) {
  return recordings::encode(*make_mcap_encoder(settings), events, piece);
}

constexpr SensorSize hd{1280, 720};

TEST(FrameDecompressor, LimitsWhatFewBytesBecome) {
  constexpr std::size_t size = std::size_t{1} << 26;
  for (const auto codec : {FrameCodec::lz4, FrameCodec::zstd}) {
    Bytes frame;
    FrameCompressor(codec).compress(Bytes(size), frame);
    FrameDecompressor decompressor;
    EXPECT_TRUE(decompressor.decompress(codec, frame, size));
    std::size_t refused = 0;
    for (int i = 0; i < 20; ++i) refused += decompressor.decompress(codec, frame, size) ? 0 : 1;
    EXPECT_EQ(refused > 0, codec == FrameCodec::zstd);  // LZ4 expands at most 255 times
  }
}

TEST(Mcap, LosesAMessageOfAnUncompressedChunkByAFlippedBit) {
  const auto events = recordings::random_events(hd, 40'000, 1, 0, 1000);
  const auto bytes = encoded({hd, BagEvents::mono, BagCompression::none}, events, 500);
  // Records of messages, whose size is from 10,000 bytes up, in 8 bytes.
  std::size_t flipped = 0;
  for (std::size_t at = 0; at + 31 < bytes.size(); ++at) {
    const auto size = little_endian<std::uint64_t>(&bytes[at + 1]);
    if (bytes[at] != 5 || size < 500 || size > 100'000 || at + 9 + size > bytes.size()) continue;
    for (const std::size_t bit : {0, 10, 20, 40, 63}) {
      auto corrupt = bytes;
      corrupt[at + 1 + bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
      const auto decoder = make_bag_decoder("");
      EXPECT_GE(decode(*decoder, corrupt).events.size(), events.size() * 8 / 10)
          << "bit " << bit << " at " << at;
      EXPECT_GE(decoder->corruption().places, 1U);
      ++flipped;
    }
    at += 9 + size - 1;
    if (flipped > 100) break;
  }
  EXPECT_GT(flipped, 20U);
}

TEST(Mcap, ReadsBackWhatItWrites) {
  constexpr Microseconds hour = 3'600'000'000;
  unsigned seed = 1;
  for (const auto format : {BagEvents::evt3, BagEvents::mono})
    for (const auto compression : {BagCompression::none, BagCompression::lz4, BagCompression::zstd})
      for (const Microseconds pause : {Microseconds{1000}, Microseconds{60'000'000}, 2 * hour}) {
        const auto start = seed % 2 * Microseconds{1'700'000'000'000'000};
        const auto events = recordings::random_events(hd, 20'000, seed++, start, pause);
        const auto bytes = encoded({hd, format, compression}, events, 1 + seed * 37);
        MemoryBytes source(bytes);
        const auto decoder = make_bag_decoder("");
        decoder->open(source);
        EXPECT_EQ(decode(*decoder, bytes).events, events);
        EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
        EXPECT_EQ(decoder->streams().front().size, hd);
        EXPECT_EQ(decoder->last_time(), events.back().t);
      }
}

TEST(Mcap, KeepsTriggersWithEvt3) {
  const auto events = recordings::random_events(hd, 20'000, 5, 1000, 1000);
  const auto encoder = make_mcap_encoder({.size = hd});
  Bytes bytes;
  std::vector<Trigger> triggers;
  for (std::size_t i = 0; i < events.size(); i += 1000) {
    triggers.push_back({events[i].t, static_cast<std::uint16_t>(i / 1000 % 16), i % 2000 == 0});
    EXPECT_TRUE(encoder->encode_trigger(triggers.back(), bytes));
    encoder->encode(std::span(events).subspan(i, 1000), bytes);
  }
  EXPECT_GT(encoder->pending(), 0U);
  encoder->finish(bytes);
  EXPECT_EQ(encoder->pending(), 0U);
  const auto decoder = make_bag_decoder("");
  const auto contents = decode(*decoder, bytes);
  EXPECT_EQ(contents.events, events);
  EXPECT_EQ(contents.triggers, triggers);
  EXPECT_FALSE(make_mcap_encoder({hd, BagEvents::mono})->encode_trigger(triggers[0], bytes));
  EXPECT_FALSE(make_mcap_encoder({.size = hd})->encode_trigger({1000, 16, true}, bytes));
}

TEST(Mcap, BeginsItsWordsWithoutAWrap) {
  for (const Microseconds t : {0, 5'000}) {
    const auto bytes = encoded({hd, BagEvents::evt3, BagCompression::none},
                               std::vector{AbsoluteEvent::at(1, 2, t, Polarity::on)});
    constexpr std::uint8_t last_time_high[] = {0xff, 0x8f};
    EXPECT_EQ(std::search(bytes.begin(), bytes.end(), std::begin(last_time_high),
                          std::end(last_time_high)),
              bytes.end());
  }
}

}  // namespace
