// SPDX-License-Identifier: LGPL-2.1-or-later
// All formats: recognition of files, round trips of those that can be read and written, and
// recordings of cameras, whose counts and checksums are another reader's.
#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "src/formats/file_formats.hpp"
#include "src/formats/recording_reader.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace eventcamera;
using formats::Format;
using recordings::below;
using recordings::Bytes;
using recordings::decode;
using recordings::encode;
using recordings::Random;
using recordings::random_events;

using namespace std::string_literals;
using namespace std::string_view_literals;

/// What a file is, by its first bytes, as GStreamer chooses among typefinders.
struct Recognised {
  std::string_view media_type;  ///< empty if the format is unknown
  Likelihood likelihood = Likelihood::none;

  friend bool operator==(const Recognised&, const Recognised&) = default;
};

Recognised recognise(std::span<const std::uint8_t> start) {
  Recognised best;
  for (const auto& format : file_formats()) {
    const auto found = likelihood(format, start);
    if (found > best.likelihood) best = {format.media_type, found};
  }
  return best;
}

Recognised recognise(std::string_view text) {
  return recognise({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

Recognised certain(std::string_view type) {
  return {type, Likelihood::certain};
}

constexpr auto hdf5 = "\x89HDF\r\n\x1a\n"sv;
constexpr auto npz =
    "PK\x03\x04-\0\0\0\0\0\0\0!\0....\xff\xff\xff\xff\xff\xff\xff\xff\x05\0\x14\0t.npy"sv;
constexpr auto lines_of_events = "1,2,100,1\n3,4,200,0\n5,6,300,1\n"sv;

TEST(Recognition, KnowsFilesByTheirFirstBytes) {
  const std::pair<std::string_view, std::string_view> starts[] = {
      {"#!AER-DAT2.0\r\n", "application/x-aedat"},
      {"#!AER-DAT4.", "application/x-aedat"},
      {"Event Stream", "application/x-es"},
      {"\x93NUMPY", "application/x-npy"},
      {npz, "application/x-npz"},
      {hdf5, "application/x-hdf5"},
      {"\x89MCAP0\r\n", "application/x-mcap"},
      {"#ROSBAG V2.0\n", "application/x-rosbag"},
      {"SQLite format 3\0..CREATE TABLE messages(id..CREATE TABLE topics(id"sv,
       "application/x-rosbag2-db3"},
      {"% evt 3.0\n", "application/x-prophesee-raw"},
      {"% date 1\n% format EVT4;height=1;width=1\n", "application/x-prophesee-raw"},
      {"% format EVT3\n", "application/x-prophesee-raw"},
      {"% evt is a comment\n% evt 2.1\r\n", "application/x-prophesee-raw"},
      {lines_of_events, "application/x-event-csv"},
      // Its time unit is missing, which is reported on reading.
      {"1000 1 2 1\n2000 1 2 1\n3000 1 2 1\n", "application/x-event-csv"}};
  for (const auto& [start, type] : starts) EXPECT_EQ(recognise(start), certain(type)) << start;
  const auto aedat3 = recordings::bytes_of("#!AER-DAT3.");
  EXPECT_EQ(file_format_of("application/x-aedat")->version(aedat3), 3);
  EXPECT_EQ(recognise("% Version 2\n% end\n\x0c\x08"),
            (Recognised{"application/x-prophesee-dat", Likelihood::high}));
  EXPECT_EQ(recognise(std::string(2048, '\0').append(hdf5)),
            (Recognised{"application/x-hdf5", Likelihood::possible}));
}

TEST(Recognition, LeavesOtherFilesAlone) {
  for (const auto text : {""sv,
                          "#!AER-DAT5.0"sv,
                          "#!AER-DAT4"sv,
                          "Event Strea"sv,
                          "% "sv,
                          "% a comment\n"sv,
                          "% evt is a comment\n"sv,
                          "% evt 3\n"sv,
                          "% evt .0\n"sv,
                          "% evt 3.\n"sv,
                          "% format EVT analysis\n"sv,
                          "% format EVT\n"sv,
                          "% format EVT3 analysis\n"sv,
                          "% Version 2\n% end\n\x0c\x10"sv,
                          "% Version 2\n% end\n\x0c"sv,
                          "A text of words.\n"sv,
                          "SQLite format 3\0..CREATE TABLE songs(id"sv,
                          "1,2,100,1\n3,4,200,0\n"sv,
                          "1,2,100,1\n3,4,200,0\n5,6,300,1\nfour\n"sv,
                          "1,2,100,1\n3,4,200,0\n5,6,300,1\n\0"sv})
    EXPECT_EQ(recognise(text), Recognised{}) << text;
  EXPECT_EQ(recognise(npz.substr(0, npz.size() - 1)), Recognised{});
  EXPECT_EQ(recognise(std::string(npz.substr(0, npz.size() - 3)) + "txt"), Recognised{});
  EXPECT_EQ(recognise(std::string(2047, '\0').append(hdf5)), Recognised{});
}

TEST(Recognition, AHeaderSaysMoreThanLinesThatWouldBeEvents) {
  EXPECT_EQ(recognise(std::string("% evt 3.0\n").append(lines_of_events)),
            certain("application/x-prophesee-raw"));
  EXPECT_EQ(recognise(std::string("% a comment\n").append(lines_of_events)),
            certain("application/x-event-csv"));
  EXPECT_EQ(recognise(std::string(lines_of_events).append(2048 - lines_of_events.size(), '\n') +
                      std::string(hdf5)),
            (Recognised{"application/x-hdf5", Likelihood::possible}));
}

TEST(Recognition, MoreBytesMakeNoOtherKind) {
  recordings::Random random(1);
  constexpr SensorSize size{640, 480};
  for (const auto& format : formats::all()) {
    if (format.name.starts_with("evt")) continue;  // words without a header
    const auto events = recordings::random_events(random, size, 20, 1000);
    const auto bytes = recordings::encode(*format.make_encoder(size), events);
    const auto whole = recognise(bytes);
    ASSERT_NE(whole.media_type, "") << format.name;
    for (std::size_t count = 0; count < bytes.size(); ++count) {
      const auto start = recognise(std::span(bytes).first(count));
      EXPECT_TRUE(start == Recognised{} || start == whole)
          << format.name << ", " << count << " bytes";
    }
  }
}

/// A file of N-MNIST.
Bytes n_mnist() {
  recordings::Random random(1);
  Bytes bytes;
  std::uint32_t t = 400;
  for (int i = 0; i < 1000; ++i) {
    t += static_cast<std::uint32_t>(recordings::below(random, 300));
    const auto upper = t >> 16 | static_cast<std::uint32_t>(i % 2) << 7;
    for (const auto byte :
         {static_cast<std::uint32_t>(i % 34), static_cast<std::uint32_t>(i % 31), upper, t >> 8, t})
      bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  return bytes;
}

TEST(Recognition, KnowsNMnistByTheOrderOfItsTimes) {
  const auto file = n_mnist();
  EXPECT_EQ(recognise(file), (Recognised{"application/x-atis-bin", Likelihood::high}));
  EXPECT_EQ(recognise(std::span(file).first(500)), Recognised{}) << "too few events";

  auto shifted = file;
  shifted.erase(shifted.begin());
  EXPECT_EQ(recognise(shifted), Recognised{});
  EXPECT_EQ(recognise(Bytes(5000)), Recognised{});
  recordings::Random random(1);
  for (int i = 0; i < 200; ++i) {
    Bytes noise(5000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    EXPECT_EQ(recognise(noise), Recognised{});
    for (std::size_t at = 0; at < noise.size(); ++at)
      noise[at] = static_cast<std::uint8_t>(at / static_cast<std::size_t>(1 + i % 7));
    EXPECT_EQ(recognise(noise), Recognised{});
  }
}

class EveryFormat : public testing::TestWithParam<Format> {
 protected:
  SensorSize random_size(Random& random) const {
    const int max_side = std::min(2048, GetParam().max_side);
    const auto side = [&] {
      return below(random, 4) == 0 ? max_side : 1 + below(random, max_side);
    };
    return {side(), side()};
  }

  std::vector<std::uint8_t> encoded(SensorSize size, std::span<const AbsoluteEvent> events) const {
    return encode(*GetParam().make_encoder(size), events);
  }
};

INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(formats::all()),
                         [](const auto& test) { return test.param.name; });

void expect_sound(const Corruption& corruption) {
  EXPECT_EQ(corruption.places, 0U) << corruption.first << " at " << corruption.first_at;
  EXPECT_EQ(corruption.outside, 0U);
}

TEST_P(EveryFormat, ReturnsWhatWasWritten) {
  Random random(1);
  for (int i = 0; i < 60; ++i) {
    const auto size = i == 0 ? SensorSize{1, 1} : random_size(random);
    const auto pause = i % 4 == 0 ? GetParam().max_pause : 100'000;
    const auto events = random_events(random, size, i % 4 == 0 ? 60 : 4000, pause);
    const auto decoder = GetParam().make_decoder(size);
    const auto decoded = decode(*decoder, encoded(size, events));
    ASSERT_EQ(decoded.events, events) << "recording " << i;
    ASSERT_TRUE(decoded.triggers.empty());
    EXPECT_EQ(decoder->size(), size);
    expect_sound(decoder->corruption());
  }
}

TEST_P(EveryFormat, TakesTheSensorsLastPixel) {
  const int last = GetParam().max_side - 1;
  const SensorSize size{last + 1, last + 1};
  const std::vector events{
      AbsoluteEvent::at(0, 0, 0, Polarity::on), AbsoluteEvent::at(last, 0, 0, Polarity::off),
      AbsoluteEvent::at(0, last, 1, Polarity::off), AbsoluteEvent::at(last, last, 1, Polarity::on)};
  EXPECT_EQ(decode(*GetParam().make_decoder(size), encoded(size, events)).events, events);
}

TEST_P(EveryFormat, IsTheSameHoweverEventsAndBytesAreSplit) {
  Random random(2);
  const SensorSize size{640, 480};
  const auto events = random_events(random, size, 2000, 1'000'000);
  for (const std::size_t at_once : {1, 7, 100}) {
    const auto bytes = encode(*GetParam().make_encoder(size), events, at_once);
    const auto make_decoder = [&] { return GetParam().make_decoder(size); };
    EXPECT_EQ(recordings::events_however_split(make_decoder, bytes), events);
  }
}

TEST_P(EveryFormat, FollowsWrapsOfTheTime) {
  // Past 24, 32 and 34 bits, up to the maximum pause of the format and slightly beyond the longest
  // wrap period.
  std::vector<AbsoluteEvent> events;
  const SensorSize size{320, 240};
  const auto step = std::min(GetParam().max_pause, 30 * formats::minutes);
  const int steps = GetParam().name == "es" ? 4 : 21;
  for (int i = 0; i < steps; ++i)
    events.push_back(AbsoluteEvent::at(i, i, step * i + i % 3, Polarity::on));
  for (const int bits : {24, 32, 34})
    for (int i = -2; i <= 2; ++i)
      if (GetParam().name != "es")
        events.push_back(
            AbsoluteEvent::at(bits, 10 + i, (Microseconds{1} << bits) + i, Polarity::off));
  std::sort(events.begin(), events.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
  const auto decoder = GetParam().make_decoder(size);
  EXPECT_EQ(decode(*decoder, encoded(size, events)).events, events);
  expect_sound(decoder->corruption());
}

TEST_P(EveryFormat, WritesDisorderWithoutHarm) {
  Random random(5);
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < 1000; ++i)
    events.push_back({static_cast<Microseconds>(random()), static_cast<std::uint16_t>(random()),
                      static_cast<std::uint16_t>(random())});
  EXPECT_LT(encoded({100, 100}, events).size(), std::size_t{1} << 31);
}

/// Corruption creates no arbitrary events, and the split does not matter.
TEST_P(EveryFormat, SurvivesCorruption) {
  Random random(7);
  const SensorSize size{640, 480};
  const auto sound = encoded(size, random_events(random, size, 2000, 1'000'000));
  for (int i = 0; i < 300; ++i) {
    auto bytes = sound;
    for (int j = 1 + below(random, 20); j > 0; --j) {
      const auto place = bytes.begin() + below(random, static_cast<int>(bytes.size()) - 10);
      const auto byte = static_cast<std::uint8_t>(random());
      const int kind = below(random, 3);
      if (kind == 0) *place = byte;
      if (kind == 1) bytes.erase(place, place + 1 + below(random, 9));
      if (kind == 2) bytes.insert(place, byte);
    }
    const auto outcome = [&](std::size_t piece) {
      const auto decoder = GetParam().make_decoder(size);
      recordings::Contents decoded;
      std::string error;
      try {
        decoded = decode(*decoder, bytes, piece);
      } catch (const UnsupportedFormat& exception) {
        error = exception.what();
      }
      const auto [width, height] = decoder->size();
      for (const auto& event : decoded.events)
        EXPECT_TRUE(width == 0 || (event.x < width && event.y() < height));
      const auto& corruption = decoder->corruption();
      return std::tuple(error, decoded.events, corruption.places, corruption.first_at,
                        corruption.first, corruption.outside);
    };
    ASSERT_EQ(outcome(0), outcome(SIZE_MAX));
  }
}

/// The events up to the next TIME_HIGH, which have one upper time, or those of a row.
TEST_P(EveryFormat, LosesFewEventsByAFlippedBit) {
  const auto& [name, max_side, max_pause, make_decoder, make_encoder] = GetParam();
  if (!name.starts_with("evt")) return;
  Random random(3);
  const SensorSize size{640, 480};
  const Microseconds unit = name == "evt3" ? 4096 : 64;
  for (const Microseconds start : {Microseconds{0}, Microseconds{3'600'000'000}}) {
    const auto events = recordings::random_events(size, 10'000, 4, start, 100'000);
    const auto file = encoded(size, events);
    for (int i = 0; i < 200; ++i) {
      auto flipped = file;
      const auto at = random() % (file.size() - 800);
      flipped[at] ^= static_cast<std::uint8_t>(1U << random() % 8);
      const auto decoder = make_decoder(size);
      const auto found = decode(*decoder, flipped).events;
      const auto first = std::ranges::mismatch(found, events);
      if (first.in2 == events.end()) continue;
      const auto last = std::mismatch(found.rbegin(), found.rend(), events.rbegin(), events.rend());
      const auto different = last.second.base() - first.in2;
      const bool has_one_time =
          different <= 0 || first.in2->t / unit == std::prev(last.second.base())->t / unit;
      EXPECT_TRUE(has_one_time || different < 40) << different << " events differ by byte " << at;
      const bool falls = !std::ranges::is_sorted(
          found, {}, [unit](const AbsoluteEvent& event) { return event.t / unit; });
      EXPECT_TRUE(decoder->corruption().places > 0 || !falls) << "byte " << at;
    }
  }
}

/// Numbers that another reader found; 0: not counted.
struct Recording {
  const char* name;
  SensorSize size;
  std::ptrdiff_t on, off;
  Microseconds t;  ///< sum of the events, and of the triggers where these are counted
  long x, y;
};

TEST(Recorded, HasTheEventsThatAnotherReaderFinds) {
  for (const auto& [name, size, on, off, t, x, y] :
       {Recording{"evt3-1280x720-triggers.raw",
                  {1280, 720},
                  41'439,
                  41'030,
                  1'222'326'831'810,
                  42'078'718,
                  31'656'267},
        Recording{
            "evt3-640x480-triggers.raw", {640, 480}, 125'183, 218'291, 2'885'601'049'874, 0, 0}}) {
    const auto file = shared_data::events_file(name);
    if (file.empty()) GTEST_SKIP() << "no " << name;
    const auto decoder = make_prophesee_raw_decoder();
    const auto decoded = recordings::decode(*decoder, file);
    Microseconds sum_t = 0;
    long sum_x = 0, sum_y = 0;
    for (const auto& event : decoded.events) {
      sum_t += event.t;
      sum_x += event.x;
      sum_y += event.y();
    }
    if (x == 0)
      for (const auto& trigger : decoded.triggers) sum_t += trigger.t;
    else
      EXPECT_EQ(decoded.triggers.size(), 2U);
    EXPECT_EQ(decoder->size(), size);
    EXPECT_EQ(std::ranges::count(decoded.events, Polarity::on, &AbsoluteEvent::polarity), on);
    EXPECT_EQ(std::ranges::count(decoded.events, Polarity::off, &AbsoluteEvent::polarity), off);
    EXPECT_EQ(sum_t, t);
    EXPECT_TRUE(x == 0 || (sum_x == x && sum_y == y));
    EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
  }
}

TEST(Recorded, PlaysEveryEventInTheOrderOfTheFile) {
  for (const std::string name : {"evt3-1280x720-triggers.raw", "evt3-640x480-triggers.raw"}) {
    const auto file = shared_data::events_file(name);
    if (file.empty()) GTEST_SKIP() << "no " << name;
    auto events = recordings::decode(*make_prophesee_raw_decoder(), file).events;
    std::ranges::stable_sort(events, {}, &AbsoluteEvent::t);
    MemoryBytes bytes(file);
    RecordingReader reader([] { return make_prophesee_raw_decoder(); }, 10'000);
    reader.open(bytes);
    std::vector<AbsoluteEvent> played;
    while (const auto output = reader.next())
      if (const auto* const chunk = std::get_if<RecordingReader::Chunk>(&*output))
        for (const auto& event : chunk->events)
          played.push_back({reader.origin() + chunk->start + event.t, event.x, event.y_p});
    EXPECT_TRUE(played == events) << name;
  }
}

}  // namespace
