// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares recordings of cameras to counts and checksums from another reader.
#include <gtest/gtest.h>

#include <algorithm>

#include "src/formats/decoder.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/recording_reader.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace eventcamera;

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
