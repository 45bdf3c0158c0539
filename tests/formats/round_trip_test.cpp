// SPDX-License-Identifier: LGPL-2.1-or-later
// Round trips of all formats that can be read and written.
#include <gtest/gtest.h>

#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using formats::Format;
using recordings::below;
using recordings::decode;
using recordings::encode;
using recordings::Random;
using recordings::random_events;

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
      Decoded decoded;
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

}  // namespace
