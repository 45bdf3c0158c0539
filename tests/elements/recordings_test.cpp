// SPDX-License-Identifier: LGPL-2.1-or-later
// Recordings of every format that an element reads: pulled, pushed, played again, and seeks.
#include "tests/elements/recording_files.hpp"
#include "tests/formats/compressed.hpp"

namespace {

using namespace recording_files;
using Events = std::vector<AbsoluteEvent>;

/// The events of the recording from `start` to before `stop`, since its first event.
Events between(Microseconds start, Microseconds stop) {
  auto events = some_events();
  for (auto& event : events) event.t -= beginning;
  std::erase_if(events, [&](const auto& event) { return event.t < start || event.t >= stop; });
  return events;
}

class EveryRecording : public testing::TestWithParam<File> {
 protected:
  static std::string launch(const std::string& way) {
    return "filesrc location=" + in_quotes(GetParam().path()) + way + GetParam().reader +
           " name=it";
  }
};
INSTANTIATE_TEST_SUITE_P(, EveryRecording, testing::ValuesIn(files()),
                         [](const auto& test) { return test_name(test.param.name); });

/// Events of a player, since the first one of the recording.
Events since(Microseconds first, Events events) {
  for (auto& event : events) event.t -= first;
  return events;
}

TEST_P(EveryRecording, IsReadPulledAndPushedAndAgain) {
  for (const std::string way : {" ! ", " ! queue ! ", " blocksize=777 ! identity ! "}) {
    SCOPED_TRACE(way);
    Player player(launch(way));
    harness::link_late_pads(player["it"], player["sink"]);
    for (const auto stop : {GST_STATE_READY, GST_STATE_NULL, GST_STATE_NULL}) {
      ASSERT_TRUE(player.play()) << player.error;
      ASSERT_FALSE(player.events.empty());
      EXPECT_TRUE(since(player.events.front().t, player.events) == between(0, length));
      EXPECT_TRUE(player.warnings.empty());
      ASSERT_TRUE(player.reaches(stop));
    }
  }
}

TEST_P(EveryRecording, IsReadAndSoughtInWhereItIsCompressed) {
  std::ifstream file(GetParam().path(), std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  for (const auto compress : {eventcamera::compressed::gzip, eventcamera::compressed::zstd}) {
    const TemporaryFile compressed(compress(bytes));
    for (const std::string way : {"", "queue ! ", "identity ! "}) {
      SCOPED_TRACE(way);
      Player player(compressed.source() + way +
                    "decodebin caps=\"application/x-event-camera,format=XYTP\" "
                    "expose-all-streams=false");
      ASSERT_TRUE(player.play()) << player.error;
      ASSERT_FALSE(player.events.empty());
      const auto first = player.events.front().t;
      EXPECT_TRUE(since(first, player.events) == between(0, length));
      constexpr Microseconds start = 3'700'000;
      ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
      ASSERT_TRUE(player.seek(start * GST_USECOND, length * GST_USECOND, GST_SEEK_FLAG_ACCURATE));
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_TRUE(since(first, player.events) == between(start, length)) << player.events.size();
      EXPECT_TRUE(player.warnings.empty());
    }
  }
}

TEST(CompressedRecordings, AreReadUpToWhereTheyAreCut) {
  std::ifstream file(Folder::path("a.csv"), std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  auto cut = eventcamera::compressed::gzip(bytes);
  cut.resize(cut.size() / 2);
  const TemporaryFile compressed(cut);
  for (const std::string way : {"", "queue ! "}) {
    Player player(compressed.source() + way + "eventcsvdec");
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_GT(player.events.size(), 10'000U);
    ASSERT_EQ(player.warnings.size(), 1U);
    EXPECT_TRUE(harness::contains(player.warnings.front(),
                                  "corrupt or cut short at byte " + std::to_string(cut.size())));
  }
}

TEST_P(EveryRecording, IsSoughtIn) {
  for (const std::string way : {" ! ", " ! queue ! "}) {
    SCOPED_TRACE(way);
    Player player(launch(way));
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    EXPECT_EQ(player.position(), 0U);
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.duration(), (length - 100 + 1) * GST_USECOND);
    const auto first = player.events.front().t;
    for (const Microseconds start : {3'700'000, 0, 499'999, 4'999'000, 100'000}) {
      constexpr Microseconds stop = 4'999'850;
      SCOPED_TRACE(start);
      ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
      ASSERT_TRUE(player.seek(start * GST_USECOND, stop * GST_USECOND, GST_SEEK_FLAG_ACCURATE));
      ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
      EXPECT_EQ(player.position(), start * GST_USECOND);
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_TRUE(since(first, player.events) == between(start, stop)) << player.events.size();
    }
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    ASSERT_TRUE(player.seek(0, 100 * GST_MSECOND, GST_SEEK_FLAG_SEGMENT));
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.end, GST_MESSAGE_SEGMENT_DONE);
    EXPECT_TRUE(since(first, player.events) == between(0, 100'000));
    EXPECT_FALSE(gst_element_seek(player.get(), -1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                  GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_SET, GST_SECOND));
    EXPECT_TRUE(player.warnings.empty());
  }
}

}  // namespace
