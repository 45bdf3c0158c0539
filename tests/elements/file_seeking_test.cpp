// SPDX-License-Identifier: LGPL-2.1-or-later
// Seeks in event files of every format.
#include <chrono>
#include <future>

#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

/// Those whose time in the player is in [from, to).
Events between(Events events, GstClockTime from, GstClockTime to = GST_CLOCK_TIME_NONE) {
  std::erase_if(events, [&, first = events.front().t](const auto& event) {
    const auto time = static_cast<GstClockTime>(event.t - first) * GST_USECOND;
    return time < from || time >= to;
  });
  return events;
}

TEST_P(EveryFormat, SeeksToBothEnds) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  struct Seek {
    GstSeekType start_type;
    gint64 start;
    gint64 stop;
    Events found;
  };
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    const auto seek = [&](GstSeekType start_type, gint64 start, gint64 stop) {
      return gst_element_seek(player.get(), 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, start_type,
                              start, GST_SEEK_TYPE_SET, stop) != FALSE;
    };
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    if (!GST_CLOCK_TIME_IS_VALID(player.duration())) {
      EXPECT_FALSE(way.empty());
      EXPECT_FALSE(seek(GST_SEEK_TYPE_END, -1, -1)) << "the end is not known";
    }
    if (!way.empty()) {
      ASSERT_TRUE(player.play()) << player.error;  // from where on it is
    }
    for (const auto& [start_type, start, stop, found] :
         {Seek{GST_SEEK_TYPE_SET, -1, GST_SECOND, between(events, 0, GST_SECOND)},
          Seek{GST_SEEK_TYPE_END, -20 * GST_SECOND, GST_SECOND, between(events, 0, GST_SECOND)},
          Seek{GST_SEEK_TYPE_END, -300 * GST_MSECOND, -1,
               between(events, 3'999'951 * GST_USECOND - 300 * GST_MSECOND)},
          Seek{GST_SEEK_TYPE_END, G_MININT64, -1, events},
          Seek{GST_SEEK_TYPE_END, G_MAXINT64, -1, {}}}) {
      ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
      ASSERT_TRUE(seek(start_type, start, stop)) << start;
      ASSERT_TRUE(player.play()) << player.error;
      EXPECT_EQ(player.events, found) << start;
    }
  }
}

/// Also a segment of no length.
TEST_P(EveryFormat, SendsASegmentBeforeItsEnd) {
  const TemporaryFile file(file_of(format(), some_events()));
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    GstClockTime last_start = GST_CLOCK_TIME_NONE;
    std::promise<GstClockTime> ended;
    const auto take_event = [&](GstEvent* event) {
      const GstSegment* segment = nullptr;
      if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) {
        gst_event_parse_segment(event, &segment);
        last_start = segment->time;
      }
      if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE) ended.set_value(last_start);
    };
    watch(GST_BASE_SINK_PAD(player["sink"]), {[](GstBuffer*) {}, take_event});
    ASSERT_TRUE(player.seek(GST_SECOND, GST_SECOND, GST_SEEK_FLAG_SEGMENT));
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.end, GST_MESSAGE_SEGMENT_DONE);
    auto start = ended.get_future();
    ASSERT_EQ(start.wait_for(std::chrono::seconds(60)), std::future_status::ready);
    EXPECT_EQ(start.get(), GST_SECOND);
  }
}

/// The segment of a seek may arrive when the next seek is already on its way.
TEST_P(EveryFormat, FollowsTheLastOfTwoSeeks) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  Player player(file.source() + "queue ! " + format().reader);
  ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(player.seek(100 * GST_MSECOND));
    ASSERT_TRUE(player.seek(GST_SECOND, 1'100 * GST_MSECOND));
    ASSERT_TRUE(player.play()) << player.error;
    ASSERT_EQ(player.events, between(events, GST_SECOND, 1'100 * GST_MSECOND));
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
  }
}

TEST_P(EveryFormat, KeepsItsPlaceWhenTheRateChanges) {
  const auto events = some_events();
  const TemporaryFile file(file_of(format(), events));
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    ASSERT_TRUE(gst_element_seek(player.get(), 2, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                 GST_SEEK_TYPE_NONE, 0, GST_SEEK_TYPE_NONE, 0));
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    ASSERT_TRUE(player.play()) << player.error;
    ASSERT_FALSE(player.events.empty());
    EXPECT_GT(player.events.front().t, events.front().t) << "it went back to the start";
    EXPECT_EQ(player.events.back(), events.back());
  }
}

}  // namespace
