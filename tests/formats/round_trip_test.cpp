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
  const int side = GetParam().max_side;
  const SensorSize size{side, side};
  const std::vector events{AbsoluteEvent::at(0, 0, 0, Polarity::on),
                           AbsoluteEvent::at(side - 1, 0, 0, Polarity::off),
                           AbsoluteEvent::at(0, side - 1, 1, Polarity::off),
                           AbsoluteEvent::at(side - 1, side - 1, 1, Polarity::on)};
  const auto decoder = GetParam().make_decoder(size);
  EXPECT_EQ(decode(*decoder, encoded(size, events)).events, events);
}

TEST_P(EveryFormat, ReadsTheSameHoweverTheBytesAreSplit) {
  Random random(2);
  const SensorSize size{640, 480};
  const auto events = random_events(random, size, 2000, 1'000'000);
  const auto bytes = encoded(size, events);
  const auto one = GetParam().make_decoder(size);
  EXPECT_EQ(decode(*one, bytes, [] { return 1; }).events, events);
  for (int i = 0; i < 50; ++i) {
    const auto decoder = GetParam().make_decoder(size);
    const auto max_bytes = 1 + below(random, 300);
    EXPECT_EQ(decode(*decoder, bytes, [&] { return 1 + below(random, max_bytes); }).events, events);
    expect_sound(decoder->corruption());
  }
}

TEST_P(EveryFormat, WritesWhatReadsTheSameHoweverTheEventsAreSplit) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    const auto size = random_size(random);
    const auto events = random_events(random, size, 3000, 1'000'000);
    const auto encoder = GetParam().make_encoder(size);
    std::vector<std::uint8_t> bytes;
    for (std::span<const AbsoluteEvent> rest = events; !rest.empty();) {
      const auto piece = rest.first(
          std::min<std::size_t>(rest.size(), static_cast<std::size_t>(below(random, 100))));
      encoder->encode(piece, bytes);
      rest = rest.subspan(piece.size());
    }
    encoder->finish(bytes);
    const auto decoder = GetParam().make_decoder(size);
    ASSERT_EQ(decode(*decoder, bytes).events, events);
    expect_sound(decoder->corruption());
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

TEST_P(EveryFormat, LeavesOutAnAbsurdSilence) {
  const SensorSize size{320, 240};
  const Microseconds now = 1'790'000'000'000'000;
  const std::vector events{AbsoluteEvent::at(1, 2, now, Polarity::on),
                           AbsoluteEvent::at(3, 4, now + 49'990, Polarity::off),
                           AbsoluteEvent::at(3, 4, now + 50'000, Polarity::off),
                           AbsoluteEvent::at(5, 6, 2 * now, Polarity::off),
                           AbsoluteEvent::at(7, 8, 2 * now + 3, Polarity::off)};
  const auto encoder = GetParam().make_encoder(size);
  const auto bytes = encode(*encoder, events);
  EXPECT_EQ(encoder->removed_time(), static_cast<std::uint64_t>(now) - 50'000);
  EXPECT_LT(bytes.size(), 2000U);
  const auto decoded = decode(*GetParam().make_decoder(size), bytes);
  const Microseconds times[] = {0, 49'990, 50'000, 50'000, 50'003};
  ASSERT_EQ(decoded.events.size(), std::size(times));
  for (std::size_t i = 0; i < std::size(times); ++i) {
    EXPECT_EQ(decoded.events[i].x, events[i].x);
    EXPECT_EQ(decoded.events[i].t, times[i]);
  }
}

TEST_P(EveryFormat, WritesDisorderWithoutHarm) {
  Random random(5);
  const SensorSize size{100, 100};
  std::vector<AbsoluteEvent> events;
  for (int i = 0; i < 1000; ++i)
    events.push_back({static_cast<Microseconds>(random()), static_cast<std::uint16_t>(random()),
                      static_cast<std::uint16_t>(random())});
  EXPECT_LT(encoded(size, events).size(), std::size_t{1} << 31);
}

TEST_P(EveryFormat, WritesAnEmptyRecording) {
  const SensorSize size{320, 240};
  const auto bytes = encoded(size, {});
  const auto decoder = GetParam().make_decoder(size);
  EXPECT_TRUE(decode(*decoder, bytes).events.empty());
  EXPECT_EQ(decoder->size(), size);
  expect_sound(decoder->corruption());
}

TEST_P(EveryFormat, GoesOnFromEverySeekPointAsIfItHadReadAll) {
  Random random(6);
  const SensorSize size{640, 480};
  const auto events = random_events(random, size, 200'000, 200'000);
  const auto bytes = encoded(size, events);
  const auto decoder = GetParam().make_decoder(size);
  ASSERT_EQ(decode(*decoder, bytes).events.size(), events.size());
  ASSERT_GT(decoder->seek_point_before(events.back().t)->position, 100'000U);
  for (int i = 0; i < 40; ++i) {
    const auto wanted = i == 0 ? 0 : events[static_cast<std::size_t>(below(random, 200'000))].t;
    const auto seek_point = decoder->seek_point_before(wanted);
    ASSERT_TRUE(seek_point);
    decoder->restart(*seek_point);
    const auto decoded = decode(*decoder, std::span(bytes).subspan(seek_point->position));
    ASSERT_LE(decoded.events.size(), events.size());
    const auto skipped = events.size() - decoded.events.size();
    ASSERT_TRUE(std::equal(decoded.events.begin(), decoded.events.end(),
                           events.begin() + static_cast<std::ptrdiff_t>(skipped)));
    // No requested event is missing.
    if (skipped != 0) {
      ASSERT_LT(events[skipped - 1].t, wanted);
    }
  }
  expect_sound(decoder->corruption());
}

/// Corruption creates no arbitrary events, and the split does not matter.
TEST_P(EveryFormat, SurvivesCorruption) {
  Random random(7);
  const SensorSize size{640, 480};
  const auto events = random_events(random, size, 2000, 1'000'000);
  const auto sound = encoded(size, events);
  for (int i = 0; i < 300; ++i) {
    auto bytes = sound;
    for (int j = 1 + below(random, 20); j > 0; --j) {
      const auto at = static_cast<std::size_t>(below(random, static_cast<int>(bytes.size())));
      const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
      switch (below(random, 4)) {
        case 0:
          *place ^= static_cast<std::uint8_t>(1 << below(random, 8));
          break;
        case 1:
          bytes.erase(place,
                      place + std::min<std::ptrdiff_t>(1 + below(random, 9), bytes.end() - place));
          break;
        case 2:
          bytes.insert(place, static_cast<std::uint8_t>(random()));
          break;
        default:
          bytes.resize(std::max<std::size_t>(at, bytes.size() / 2));
      }
      if (bytes.empty()) bytes.push_back(0);
    }
    const auto outcome = [&](auto next_piece) {
      const auto decoder = GetParam().make_decoder(size);
      std::string error;
      Decoded decoded;
      try {
        decoded = decode(*decoder, bytes, next_piece);
      } catch (const UnsupportedFormat& exception) {
        error = exception.what();
      }
      for (const auto& event : decoded.events) {
        const int width = decoder->size().width;
        const int height = decoder->size().height;
        EXPECT_TRUE(width == 0 || (event.x < width && event.y() < height));
      }
      const auto& corruption = decoder->corruption();
      return std::tuple(error, decoded.events, corruption.places, corruption.first_at,
                        corruption.first, corruption.outside);
    };
    const auto whole = outcome([&] { return bytes.size(); });
    ASSERT_EQ(outcome([&] { return 1 + below(random, 50); }), whole);
  }
}

TEST_P(EveryFormat, TellsACutFile) {
  Random random(8);
  const SensorSize size{640, 480};
  // DAT and Event Stream files end with an event, and the words of the others are longer than a
  // byte.
  const auto events = random_events(random, size, 100, 1000);
  auto bytes = encoded(size, events);
  bytes.pop_back();
  const auto decoder = GetParam().make_decoder(size);
  const auto decoded = decode(*decoder, bytes);
  EXPECT_EQ(decoder->corruption().places, 1U);
  EXPECT_LT(decoder->corruption().first_at, bytes.size());
  EXPECT_GE(decoder->corruption().first_at + 8, bytes.size());
  EXPECT_TRUE(std::equal(decoded.events.begin(), decoded.events.end(), events.begin()));
}

}  // namespace
