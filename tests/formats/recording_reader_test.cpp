// SPDX-License-Identifier: LGPL-2.1-or-later
// Recordings without GStreamer: push and pull mode give equal items; seeking and duration.
#include "src/formats/recording_reader.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/numpy/npy_decoder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <iterator>
#include <map>
#include <string>
#include <tuple>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "tests/formats/recordings.hpp"

namespace eventcamera {
namespace {

using recordings::Bytes;
using recordings::Events;

constexpr SensorSize sensor{320, 240};
constexpr Microseconds chunk_length = 10'000;

/// A dot that runs through the rows for a second, from 2 s on, and again after a silence of three
/// seconds.
Events some_events() {
  Events events;
  for (int i = 0; i < 20'000; ++i) {
    const Microseconds t = 2'000'000 + 50 * i + (i >= 10'000 ? 3'000'000 : 0);
    events.push_back(AbsoluteEvent::at(i % sensor.width, i / sensor.width, t,
                                       i % 3 == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

struct File {
  std::string name;
  Bytes bytes;
  RecordingReader::MakeDecoder make_decoder;
};

File raw_file() {
  const auto encoder = make_prophesee_raw_encoder(EvtFormat::evt3, sensor);
  return {"raw", recordings::encode(*encoder, some_events()),
          [] { return make_prophesee_raw_decoder(); }};
}

/// Without a stated size, and readable only from the start.
File npy_file() {
  NpyEncoder encoder;
  return {"npy", recordings::encode(encoder, some_events()), [] { return make_npy_decoder(); }};
}

/// Encodes a frame whose pixels contain its number.
void add_picture(Aedat4Encoder& encoder, Microseconds t, int number, Bytes& bytes, int width = 5,
                 int height = 3) {
  const Bytes pixels(static_cast<std::size_t>(width * height), static_cast<std::uint8_t>(number));
  encoder.encode({t, t, t, t, t, PixelFormat::grey8, width, height, 0, 0, pixels.data(), width},
                 bytes);
}

Events from(const Events& events, Microseconds start, Microseconds stop) {
  Events found;
  std::ranges::copy_if(events, std::back_inserter(found),
                       [&](const auto& event) { return event.t >= start && event.t < stop; });
  return found;
}

/// Events, and a frame every 100 ms, starting 50 ms earlier.
File aedat_file(bool has_table) {
  Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::lz4, true, has_table});
  Bytes bytes;
  const auto events = some_events();
  auto last = events.front().t - 50'000;
  for (int i = 0; i < 40; ++i, last += 100'000) {
    if (i > 0) encoder.encode(from(events, last - 100'000, last), bytes);
    add_picture(encoder, last, i, bytes);
  }
  encoder.encode(from(events, last - 100'000, INT64_MAX), bytes);
  encoder.finish(bytes);
  recordings::apply_patch(encoder, bytes);
  return {has_table ? "aedat_with_a_table" : "aedat_without_a_table", std::move(bytes),
          [] { return make_aedat_decoder(); }};
}

/// As an older DV writes them: the table has the positions of the packets, and zeros.
File aedat_file_with_a_table_of_zeros() {
  auto file = aedat_file(true);
  const auto header = read_aedat4_header(file.bytes).value();
  const auto table_at = static_cast<std::ptrdiff_t>(header.table_at.value());
  auto table = read_aedat4_table(std::span(file.bytes).subspan(*header.table_at),
                                 header.compression, header.packets_at);
  for (auto& entry : table.value()) entry.elements = entry.start = entry.end = 0;
  file.name = "aedat_with_a_table_of_zeros";
  file.bytes.erase(file.bytes.begin() + table_at, file.bytes.end());
  make_aedat4_compressor(header.compression).compress(aedat4_table_content(*table), file.bytes);
  return file;
}

struct Outcome {
  using Chunk = std::tuple<std::size_t, Microseconds, Microseconds, std::vector<Event>>;
  using Picture = std::tuple<std::size_t, Microseconds, std::uint8_t>;

  std::size_t starts = 0;
  std::vector<Chunk> chunks;
  std::vector<Picture> pictures;
  std::vector<Trigger> triggers;
  std::vector<Microseconds> waiting;  ///< triggers whose chunk has to follow

  void take(const RecordingReader::Start& /*start*/) { ++starts; }
  void take(const RecordingReader::Chunk& chunk) {
    for (const auto t : std::exchange(waiting, {})) {
      EXPECT_GE(t, chunk.start);
      EXPECT_LT(t, chunk.start + chunk.duration);
    }
    chunks.emplace_back(chunk.stream, chunk.start, chunk.duration,
                        std::vector<Event>(chunk.events.begin(), chunk.events.end()));
  }
  void take(const RecordingReader::TimedFrame& item) {
    pictures.emplace_back(item.stream, item.time, item.frame.pixels[0]);
  }
  void take(const TriggerItem& item) {
    for (const auto& trigger : item.triggers) {
      triggers.push_back(trigger);
      if (trigger.t >= 0) waiting.push_back(trigger.t);
    }
  }
  void take(const ImuItem& /*item*/) {}

  void take_all(RecordingReader& reader) {
    while (const auto output = reader.next())
      std::visit([this](const auto& item) { take(item); }, *output);
  }

  /// Pushes the file in pieces, each in memory of its own.
  void take_all(RecordingReader& reader, std::span<const std::uint8_t> file, std::size_t piece) {
    for (const auto part : recordings::pieces_of(file, piece)) {
      const Bytes copy(part.begin(), part.end());
      reader.push(copy);
      take_all(reader);
    }
    EXPECT_FALSE(reader.at_end());
    reader.finish();
    take_all(reader);
    EXPECT_TRUE(reader.at_end());
  }

  /// Events of one stream, without silences.
  Events events(Microseconds origin) const {
    Events events;
    for (const auto& [stream, start, duration, of_chunk] : chunks)
      for (const auto& event : of_chunk) {
        EXPECT_LE(event.t, duration);
        events.push_back({origin + start + event.t, event.x, event.y_p});
      }
    return events;
  }

  void expect_no_overlap() const {
    std::map<std::size_t, Microseconds> end;
    for (const auto& [stream, start, duration, of_chunk] : chunks) {
      EXPECT_GE(start, end[stream]);
      end[stream] = start + duration;
    }
  }
};

class Recording : public testing::TestWithParam<File> {};
INSTANTIATE_TEST_SUITE_P(, Recording,
                         testing::Values(raw_file(), npy_file(), aedat_file(true),
                                         aedat_file_with_a_table_of_zeros(), aedat_file(false)),
                         [](const auto& test) { return test.param.name; });

TEST_P(Recording, IsTheSamePushedAndPulled) {
  const auto& [name, file, make_decoder] = GetParam();
  const Microseconds origin = name.starts_with("aedat") ? 1'950'000 : 2'000'000;
  recordings::BreakableBytes bytes(file);
  bytes.is_broken = true;
  RecordingReader pulled(make_decoder, chunk_length);
  pulled.open(bytes);
  EXPECT_FALSE(pulled.duration());
  EXPECT_FALSE(pulled.next());
  EXPECT_FALSE(pulled.at_end());
  bytes.is_broken = false;
  Outcome expected;
  expected.take_all(pulled);
  EXPECT_TRUE(pulled.at_end());
  EXPECT_EQ(expected.starts, 1U);
  EXPECT_EQ(pulled.origin(), origin);
  EXPECT_EQ(pulled.duration(), 5'999'950 + 1 - origin);
  EXPECT_EQ(expected.events(origin), some_events());
  expected.expect_no_overlap();
  EXPECT_EQ(pulled.counts().events, some_events().size());
  EXPECT_EQ(pulled.counts().frames, expected.pictures.size());
  EXPECT_EQ(pulled.counts().corrupt_places, 0U);
  for (const std::size_t size : {1UL, 0UL, 1UL << 24}) {
    RecordingReader pushed(make_decoder, chunk_length);
    Outcome outcome;
    outcome.take_all(pushed, file, size);
    EXPECT_EQ(pushed.origin(), origin);
    EXPECT_EQ(outcome.events(origin), some_events());
    outcome.expect_no_overlap();
    EXPECT_EQ(outcome.pictures, expected.pictures);
    EXPECT_EQ(pushed.streams().size(), pulled.streams().size());
  }
}

/// Events, and a frame every 100 ms; all of one before the first of the other.
Bytes aedat_of_parts(bool frames_first) {
  Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::none, true, false});
  Bytes bytes;
  const auto events = some_events();
  if (!frames_first) encoder.encode(events, bytes);
  for (int i = 0; i < 40; ++i) add_picture(encoder, events.front().t + i * 100'000, i, bytes);
  if (frames_first) encoder.encode(events, bytes);
  encoder.finish(bytes);
  return bytes;
}

TEST(RecordingReader, ReadsStreamsThatAreWrittenOneAfterTheOther) {
  for (const bool frames_first : {false, true}) {
    const auto bytes = aedat_of_parts(frames_first);
    for (const std::size_t size : {std::size_t{1000}, bytes.size()}) {
      RecordingReader reader([] { return make_aedat_decoder(); }, chunk_length);
      Outcome outcome;
      outcome.take_all(reader, bytes, size);
      EXPECT_EQ(outcome.events(reader.origin()), some_events());
      EXPECT_EQ(outcome.pictures.size(), 40U);
      EXPECT_EQ(reader.counts().late, 0U);
      std::map<std::size_t, Microseconds> end;
      for (const auto& [stream, start, duration, of_chunk] : outcome.chunks) {
        if (of_chunk.empty()) {
          EXPECT_GE(start, end[stream]);
        }
        end[stream] = std::max(end[stream], start + duration);
      }
    }

    MemoryBytes source(bytes);
    RecordingReader reader([] { return make_aedat_decoder(); }, chunk_length);
    reader.open(source);
    reader.seek(200'000, 400'000);
    Outcome part;
    part.take_all(reader);
    EXPECT_EQ(part.events(reader.origin()), from(some_events(), 2'200'000, 2'400'000));
    EXPECT_EQ(part.pictures.size(), 2U);
  }
}

/// File that is read in small pieces, and tells how far.
class WatchedBytes final : public ByteSource {
 public:
  explicit WatchedBytes(const Bytes& bytes) : bytes_(bytes) {}

  std::uint64_t size() const override { return bytes_.size(); }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    return bytes_.read(position, out);
  }
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override {
    const auto piece =
        bytes_.piece(position)->first(std::min<std::uint64_t>(size() - position, 4096));
    end = std::max(end, position + piece.size());
    return piece;
  }

  std::uint64_t end = 0;

 private:
  MemoryBytes bytes_;
};

/// The index of the file tells that a stream has no more items in the segment.
TEST(RecordingReader, DoesNotReadOnWhileAStreamIsSilent) {
  const auto all = some_events();
  struct Case {
    std::size_t events;
    int frames;  ///< one every 10 ms
    Microseconds stop;
  };
  for (const auto& [count, frames, stop] :
       {Case{all.size(), 3, 200'000}, Case{1'010, 300, 500'000}}) {
    Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::none, true, true});
    Bytes bytes;
    const std::vector events(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count));
    for (int i = 0; i < frames; ++i) {
      const auto t = all.front().t + i * 10'000;
      encoder.encode(from(events, t, t + 10'000), bytes);
      add_picture(encoder, t, i, bytes, 64, 48);
    }
    encoder.encode(from(events, all.front().t + frames * 10'000, all.back().t + 1), bytes);
    encoder.finish(bytes);
    recordings::apply_patch(encoder, bytes);
    WatchedBytes source(bytes);
    RecordingReader reader([] { return make_aedat_decoder(); }, chunk_length);
    reader.open(source);
    reader.seek(0, stop);
    Outcome outcome;
    outcome.take_all(reader);
    EXPECT_TRUE(reader.is_past_stop());
    EXPECT_EQ(outcome.events(reader.origin()), from(events, all.front().t, all.front().t + stop));
    EXPECT_EQ(outcome.pictures.size(),
              static_cast<std::size_t>(std::min<Microseconds>(frames, stop / 10'000)));
    EXPECT_LT(source.end, bytes.size() / 2);
  }
}

TEST(RecordingReader, TriggersPrecedeTheChunkOfTheirInterval) {
  const auto events = some_events();
  std::vector<Trigger> triggers{{1'900'000, 3, true}};  // before the origin
  const auto encoder = make_prophesee_raw_encoder(EvtFormat::evt3, sensor);
  Bytes bytes;
  encoder->encode_trigger(triggers.front(), bytes);
  for (std::size_t i = 0; i < events.size(); i += 1000) {
    encoder->encode(std::span(events).subspan(i, 1000), bytes);
    triggers.push_back({events[i + 999].t, static_cast<std::uint16_t>(i / 1000 % 8), i % 2 == 0});
    encoder->encode_trigger(triggers.back(), bytes);
  }
  encoder->finish(bytes);
  const auto make_decoder = [] { return make_prophesee_raw_decoder(); };
  for (const std::size_t size : {1UL, 0UL, 1UL << 24}) {
    RecordingReader reader(make_decoder, chunk_length);
    Outcome outcome;
    outcome.take_all(reader, bytes, size);
    for (auto& trigger : outcome.triggers) trigger.t += reader.origin();
    EXPECT_EQ(outcome.triggers, triggers);
    EXPECT_EQ(reader.counts().triggers, triggers.size());
  }

  MemoryBytes source(bytes);
  RecordingReader reader(make_decoder, chunk_length);
  reader.open(source);
  reader.seek(3'700'000, 3'900'000);
  Outcome sought;
  sought.take_all(reader);
  ASSERT_EQ(sought.triggers.size(), 4U);
  EXPECT_EQ(reader.counts().triggers, 4U);
  for (const auto& trigger : sought.triggers) {
    EXPECT_GE(trigger.t, 3'700'000);
    EXPECT_LT(trigger.t, 3'900'000);
  }
}

TEST(RecordingReader, GuessesTheSizeOfASensorFromMostEvents) {
  constexpr int count = 8000;
  // Some beyond any sensor, and others within one that no other event needs.
  constexpr std::pair<int, int> strays[] = {{16000, 100}, {3, 16000}, {4000, 3000}, {900, 700}};
  Events events;
  for (int i = 0; i < count; ++i) {
    events.push_back(AbsoluteEvent::at(i % 240, i % 180, Microseconds{1000} * i, Polarity::on));
    if (i % 1000 != 500) continue;
    const auto& [x, y] = strays[i / 1000 % std::size(strays)];
    events.push_back(AbsoluteEvent::at(x, y, events.back().t, Polarity::off));
  }
  NpyEncoder encoder;
  const auto bytes = recordings::encode(encoder, events);
  const auto make_decoder = npy_file().make_decoder;
  for (const std::size_t piece_size : {bytes.size(), std::size_t{4000}}) {
    RecordingReader reader(make_decoder, chunk_length);
    Outcome outcome;
    outcome.take_all(reader, bytes, piece_size);
    EXPECT_EQ(outcome.events(0).size(), std::size_t{count}) << piece_size;
    EXPECT_EQ(reader.streams().front().size_from, RecordingReader::SizeFrom::assumption);
    EXPECT_EQ(reader.counts().outside, 8U) << piece_size;
    EXPECT_EQ(reader.streams().front().info.size, (SensorSize{240, 180})) << piece_size;
  }
}

TEST(UsedPixels, AreImplausibleWhereMoreThanAFewLieBeyondAnySensor) {
  const auto are_implausible = [](std::size_t within, std::size_t beyond, std::uint64_t outside) {
    UsedPixels used;
    used.include(Events(within, AbsoluteEvent::at(4095, 4095, 0, Polarity::on)));
    used.include(Events(beyond, AbsoluteEvent::at(4096, 0, 0, Polarity::on)));
    return used.are_implausible(outside);
  };
  EXPECT_FALSE(are_implausible(0, 0, 0));
  EXPECT_FALSE(are_implausible(2, 1, 0));
  EXPECT_FALSE(are_implausible(2, 0, 1));
  EXPECT_TRUE(are_implausible(2, 2, 0));
  EXPECT_TRUE(are_implausible(2, 1, 1));
  EXPECT_FALSE(are_implausible(990, 10, 0));
  EXPECT_TRUE(are_implausible(990, 10, 1));
}

/// Longer than the surveyed part and slower at its end, so that no estimate is right.
Events many_events(Microseconds first, Microseconds step) {
  Events events;
  auto t = first;
  for (int i = 0; i < 2'500'000; ++i, t += i < 2'000'000 ? step : 5 * step)
    events.push_back(AbsoluteEvent::at(i % 100, i % 77, t, Polarity::on));
  events.back().t = events[events.size() - 2].t - 1;  // slightly out of order
  return events;
}

TEST(RecordingReader, ReadsTheDurationOfFixedRecordsAtTheEnd) {
  constexpr Microseconds hour = 3'600'000'000;
  NpyEncoder npy;
  const auto dat = make_dat_encoder(sensor);
  // Ten hours of DAT are eight wraps of its time.
  const struct {
    Encoder& encoder;
    Events events;
    RecordingReader::MakeDecoder make_decoder;
  } files[] = {
      {npy, many_events(7, 100), npy_file().make_decoder},
      {*dat, many_events(hour, 8'000), [] { return make_dat_decoder(); }},
  };
  for (const auto& [encoder, events, make_decoder] : files) {
    MemoryBytes bytes(recordings::encode(encoder, events));
    RecordingReader reader(make_decoder, chunk_length);
    reader.open(bytes);
    ASSERT_TRUE(reader.next());
    const auto last = std::ranges::max_element(events, {}, &AbsoluteEvent::t)->t;
    EXPECT_EQ(reader.duration(), last + 1 - events.front().t);
  }
}

/// More than the surveyed bytes of a silence; then events, of which the last block that is surveyed
/// has too few to tell whether the clock jumped.
TEST(RecordingReader, FindsTheFirstEventsAfterALongSilence) {
  constexpr std::size_t silence = std::size_t{20} << 20;  // bytes
  constexpr int count = 3000;
  const std::string_view header("Event Stream\2\0\0\1\x40\1\xf0\0", 20);
  Bytes bytes(header.begin(), header.end());
  bytes.resize(silence - 500, 0xff);  // 127 us each
  const auto first = static_cast<Microseconds>(127 * (bytes.size() - header.size()) + 10);
  for (int i = 0; i < count; ++i)
    for (const int byte : {10 << 1 | 1, i % 256, 0, i % sensor.height, 0})
      bytes.push_back(static_cast<std::uint8_t>(byte));
  MemoryBytes all(bytes);
  WatchedBytes source(bytes);
  for (ByteSource* const from : std::initializer_list<ByteSource*>{&all, &source}) {
    RecordingReader reader([] { return make_event_stream_decoder(); }, chunk_length);
    reader.open(*from);
    Outcome outcome;
    outcome.take_all(reader);
    EXPECT_FALSE(reader.is_empty());
    EXPECT_EQ(reader.origin(), first);
    EXPECT_GT(reader.duration(), 0);
    EXPECT_EQ(outcome.events(0).size(), std::size_t{count});
  }
}

/// EVT3 words, of which the last is incomplete.
Bytes words_of(std::initializer_list<std::uint16_t> words) {
  Bytes bytes;
  for (const auto word : words) {
    bytes.push_back(static_cast<std::uint8_t>(word));
    bytes.push_back(static_cast<std::uint8_t>(word >> 8));
  }
  bytes.pop_back();
  return bytes;
}

TEST(RecordingReader, KeepsNoStateOfWordsThroughADiscontinuity) {
  RecordingReader reader([] { return make_evt_decoder(EvtFormat::evt3, sensor); }, chunk_length,
                         RecordingReader::Clock::stream);
  Outcome outcome;
  const auto read = [&](const Bytes& words) {
    reader.push(words, RecordingReader::Interval{0, 0});
    outcome.take_all(reader);
    reader.advance_to(chunk_length);
    outcome.take_all(reader);
    return std::exchange(outcome.chunks, {});
  };
  // Time, row, event, trigger, vector.
  EXPECT_EQ(read(words_of({0x8009, 0x6000, 0x0007, 0x2001, 0xa001, 0x3003, 0x4001, 0})).size(), 1U);
  EXPECT_EQ(outcome.triggers.size(), 1U);
  reader.interrupt();
  // An event before the time and before the row, a vector without a base, a row and an event.
  const auto chunks = read(words_of({0x2001, 0x8002, 0x6000, 0x2002, 0x4001, 0x0009, 0x2003, 0}));
  ASSERT_EQ(chunks.size(), 1U);
  EXPECT_EQ(std::get<3>(chunks.front()), (std::vector{Event::at(3, 9, 0, Polarity::off)}));
  EXPECT_EQ(outcome.triggers.size(), 1U);
  EXPECT_EQ(reader.counts().corrupt_places, 1U);
  EXPECT_EQ(reader.corruption().first_at, 15U + 8U);
  EXPECT_EQ(reader.streams().front().info.size, sensor);
}

/// A table in any order: pulled, it is sorted; pushed, it is refused, however it is divided.
TEST(RecordingReader, SortsATableOrRefusesIt) {
  const auto sorted = some_events();
  auto shuffled = sorted;
  std::mt19937 random(3);
  std::ranges::shuffle(shuffled, random);
  // Few rows are not told apart from a flipped bit by their number, but by their share.
  for (const auto& events : {shuffled, Events(shuffled.begin(), shuffled.begin() + 10)}) {
    NpyEncoder encoder;
    const auto file = recordings::encode(encoder, events);
    auto expected = events;
    std::ranges::stable_sort(expected, {}, &AbsoluteEvent::t);
    const auto first = expected.front().t;
    for (const SensorSize size : {SensorSize{}, sensor}) {
      const auto make = [size] { return make_npy_decoder(TableSettings{.size = size}); };
      MemoryBytes bytes(file);
      RecordingReader pulled(make, chunk_length);
      pulled.open(bytes);
      Outcome outcome;
      outcome.take_all(pulled);
      EXPECT_EQ(outcome.events(first), expected);
      EXPECT_TRUE(pulled.is_sorted());
      EXPECT_EQ(pulled.duration(), expected.back().t + 1 - first);
      EXPECT_EQ(pulled.counts().late + pulled.counts().stray, 0U);

      const Microseconds start = (expected.back().t - first) / 2;
      Outcome sought;
      pulled.seek(start, std::nullopt);
      sought.take_all(pulled);
      EXPECT_EQ(sought.events(first), from(expected, first + start, expected.back().t + 1));

      std::vector<std::string> errors;
      for (const std::size_t piece : {1UL, 1000UL, 1UL << 24}) {
        RecordingReader pushed(make, chunk_length);
        Outcome before;
        try {
          before.take_all(pushed, file, piece);
        } catch (const UnsupportedFormat& error) {
          errors.emplace_back(error.what());
        }
      }
      ASSERT_EQ(errors.size(), 3U);
      EXPECT_NE(errors[0].find("not sorted by time"), std::string::npos) << errors[0];
      EXPECT_EQ(std::ranges::count(errors, errors[0]), 3);
    }
  }
}

TEST(RecordingReader, DropsAWrongTimeOfALongTable) {
  auto events = some_events();
  events[100].t += Microseconds{1} << 30;
  NpyEncoder encoder;
  MemoryBytes table(recordings::encode(encoder, events));
  RecordingReader pulled([] { return make_npy_decoder(); }, chunk_length);
  pulled.open(table);
  Outcome outcome;
  outcome.take_all(pulled);
  EXPECT_FALSE(pulled.is_sorted());
  EXPECT_EQ(pulled.counts().stray, 1U);
}

}  // namespace
}  // namespace eventcamera
