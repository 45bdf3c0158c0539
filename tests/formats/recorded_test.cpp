// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares recordings of cameras to counts and checksums from another reader.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "src/formats/decoder.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/recording_reader.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;

std::string path(const std::string& name) {
  const char* shared = std::getenv("SHARED_DATA");
  return std::string(shared != nullptr ? shared : "") + "/events/" + name;
}

std::vector<std::uint8_t> bytes_of(const std::string& name) {
  std::ifstream file(path(name), std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

struct Sums {
  Microseconds t = 0;
  long x = 0, y = 0, on = 0, off = 0;
};

Sums sums_of(const Decoded& decoded) {
  Sums sums;
  for (const auto& event : decoded.events) {
    sums.t += event.t;
    sums.x += event.x;
    sums.y += event.y();
    ++(event.polarity() == Polarity::on ? sums.on : sums.off);
  }
  return sums;
}

TEST(Recorded, Evt3Of1280x720) {
  const std::string name = "evt3-1280x720-triggers.raw";
  if (!std::filesystem::exists(path(name))) GTEST_SKIP() << "no " << path(name);
  const auto decoder = make_prophesee_raw_decoder();
  const auto decoded = recordings::decode(*decoder, bytes_of(name));
  const auto sums = sums_of(decoded);
  EXPECT_EQ(decoder->size(), (SensorSize{1280, 720}));
  EXPECT_EQ(decoded.events.size(), 82'469U);
  EXPECT_EQ(decoded.triggers.size(), 2U);
  EXPECT_EQ(sums.t, 1'222'326'831'810);
  EXPECT_EQ(sums.x, 42'078'718);
  EXPECT_EQ(sums.y, 31'656'267);
  EXPECT_EQ(sums.on, 41'439);
  EXPECT_EQ(decoder->corruption().places, 0U);
  EXPECT_EQ(decoder->corruption().outside, 0U);
}

TEST(Recorded, Evt3Of640x480) {
  const std::string name = "evt3-640x480-triggers.raw";
  if (!std::filesystem::exists(path(name))) GTEST_SKIP() << "no " << path(name);
  const auto decoder = make_prophesee_raw_decoder();
  const auto decoded = recordings::decode(*decoder, bytes_of(name));
  auto sums = sums_of(decoded);
  for (const auto& trigger : decoded.triggers) sums.t += trigger.t;
  EXPECT_EQ(decoder->size(), (SensorSize{640, 480}));
  EXPECT_EQ(sums.off, 218'291);
  EXPECT_EQ(sums.on, 125'183);
  EXPECT_EQ(sums.t, 2'885'601'049'874);
  EXPECT_EQ(decoder->corruption().places, 0U);
  EXPECT_EQ(decoder->corruption().outside, 0U);
}

TEST(Recorded, PlaysEveryEventInTheOrderOfTheFile) {
  for (const std::string name : {"evt3-1280x720-triggers.raw", "evt3-640x480-triggers.raw"}) {
    if (!std::filesystem::exists(path(name))) GTEST_SKIP() << "no " << path(name);
    auto events = recordings::decode(*make_prophesee_raw_decoder(), bytes_of(name)).events;
    std::ranges::stable_sort(events, {}, &AbsoluteEvent::t);
    MemoryBytes bytes(bytes_of(name));
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
