// SPDX-License-Identifier: LGPL-2.1-or-later
// Times and order of intervals, and discontinuities between frames.
#include <algorithm>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

const std::string video = "video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1";
const std::string uneven = "video/x-raw, format=GRAY8, width=32, height=24, framerate=0/1";

class EverySimulator : public testing::TestWithParam<const char*> {
 protected:
  EverySimulator() : h(GetParam()) {}
  explicit EverySimulator(GstHarness* bare) : h(bare, GetParam()) {}

  /// A frame that differs from the one before.
  GstFlowReturn flash(GstClockTime pts, guint flags = 0) {
    bright = !bright;
    GstBuffer* buffer = h.flat(pts, bright ? 200 : 50);
    GST_BUFFER_FLAG_SET(buffer, flags);
    return h.push(buffer);
  }

  /// The last frame again, flagged as videorate flags its copies.
  GstFlowReturn repeat(GstClockTime pts) {
    GstBuffer* buffer = h.flat(pts, bright ? 200 : 50);
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_GAP);
    return h.push(buffer);
  }

  void expect_interval(GstClockTime start, GstClockTime end) {
    const auto buffer = h.pull();
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), start);
    EXPECT_EQ(GST_BUFFER_DURATION(buffer.get()), end - start);
    EXPECT_EQ(GST_BUFFER_DTS(buffer.get()), GST_CLOCK_TIME_NONE);
    for (const auto& event : events_of(buffer.get())) ASSERT_LE(event.t, (end - start) / 1000);
  }

  Harness h;
  bool bright = false;
};
INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

/// Simulators on the GPU upload their frames: glupload drops flags.
class EverySimulatorAlone : public EverySimulator {
 protected:
  EverySimulatorAlone()
      : EverySimulator((gst_init(nullptr, nullptr), gst_harness_new_parse(GetParam()))) {}
};
INSTANTIATE_TEST_SUITE_P(, EverySimulatorAlone, testing::ValuesIn(simulators));

TEST_P(EverySimulator, SendsAGapForAnIntervalWithoutEvents) {
  h.caps(video);
  h.push(h.flat(0, 90));
  h.push(h.flat(40 * GST_MSECOND, 90));
  EXPECT_FALSE(h.pull());
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  const auto [start, duration] = gap_of(gap.get());
  EXPECT_EQ(start, 0U);
  EXPECT_EQ(duration, 40 * GST_MSECOND);
}

TEST_P(EverySimulator, DrawsAPictureForEveryFrameAtItsTime) {
  h.caps(video, pictures_of(GetParam()));
  std::vector<std::string> pictures;
  for (int i = 0; i < 6; ++i) {
    GstBuffer* frame = h.flat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, i < 3 ? 60 : 200);
    GST_BUFFER_DURATION(frame) = 39 * GST_MSECOND;
    if (i == 5) GST_BUFFER_FLAG_SET(frame, GST_BUFFER_FLAG_DISCONT);
    h.push(frame);
    const auto picture = h.pull();
    ASSERT_TRUE(picture) << i;
    EXPECT_EQ(GST_BUFFER_PTS(picture.get()), i * 40 * GST_MSECOND);
    EXPECT_EQ(GST_BUFFER_DURATION(picture.get()), 39 * GST_MSECOND);
    EXPECT_EQ(GST_BUFFER_IS_DISCONT(picture.get()), i == 5);
    pictures.push_back(bytes_of(picture.get()));
  }
  const std::string& empty = pictures[0];
  EXPECT_EQ(empty.substr(4), empty.substr(0, empty.size() - 4));  // of one colour
  EXPECT_EQ(pictures[2], empty);
  EXPECT_NE(pictures[3], empty);  // at the time of the frame that changed
  EXPECT_EQ(pictures[5], empty);
  EXPECT_FALSE(h.pull_event(GST_EVENT_GAP));
}

TEST_P(EverySimulator, DrawsWithoutLatency) {
  h.caps(video, pictures_of(GetParam()));
  gst_harness_set_upstream_latency(h.get(), 5 * GST_MSECOND);
  flash(0);
  flash(120 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 5 * GST_MSECOND);
}

TEST_P(EverySimulator, DrawsNothingInAGapOfTheVideo) {
  h.caps(video, pictures_of(GetParam()));
  flash(0);
  EXPECT_TRUE(h.pull());
  gst_harness_push_event(h.get(), gst_event_new_gap(40 * GST_MSECOND, 100 * GST_MSECOND));
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap_of(gap.get()).start, 40 * GST_MSECOND);
  EXPECT_EQ(gap_of(gap.get()).duration, 100 * GST_MSECOND);
  flash(140 * GST_MSECOND);
  const auto picture = h.pull();
  ASSERT_TRUE(picture);
  EXPECT_EQ(GST_BUFFER_PTS(picture.get()), 140 * GST_MSECOND);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, BeginsAnewAfterADiscontinuity) {
  h.caps(video);
  flash(0);
  flash(40 * GST_MSECOND);
  expect_interval(0, 40 * GST_MSECOND);
  flash(80 * GST_MSECOND, GST_BUFFER_FLAG_DISCONT);
  EXPECT_FALSE(h.pull());
  flash(120 * GST_MSECOND);
  const auto buffer = h.pull();
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), 80 * GST_MSECOND);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(buffer.get()));
  flash(160 * GST_MSECOND);
  const auto next = h.pull();
  ASSERT_TRUE(next);
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(next.get()));
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, BeginsAnewAfterAFrameThatFails) {
  for (const auto& out : {std::string(GST_EVENT_CAMERA_MEDIA_TYPE), pictures_of(GetParam())}) {
    Harness bare(gst_harness_new_parse(GetParam()), GetParam());
    bare.caps(video, out);
    std::vector<bool> discontinuous;
    for (int i = 0; i < 7; ++i) {
      GstBuffer* frame = bare.flat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, i % 2 * 150);
      if (i == 3) gst_buffer_set_size(frame, 1);
      EXPECT_EQ(bare.push(frame), i == 3 ? GST_FLOW_ERROR : GST_FLOW_OK);
      if (i == 2)
        while (bare.pull()) continue;
    }
    EXPECT_TRUE(bare.message(GST_MESSAGE_ERROR));
    while (const auto output = bare.pull())
      discontinuous.push_back(GST_BUFFER_IS_DISCONT(output.get()));
    ASSERT_GE(discontinuous.size(), 2U);
    EXPECT_TRUE(discontinuous[0]);
    EXPECT_FALSE(discontinuous[1]);
  }
}

TEST_P(EverySimulator, BeginsAnewInAnotherSegmentButNotInTheSame) {
  h.caps(video);
  flash(0);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  flash(40 * GST_MSECOND);
  expect_interval(0, 40 * GST_MSECOND);
  segment.start = segment.time = 5 * GST_SECOND;
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  flash(5 * GST_SECOND);
  EXPECT_FALSE(h.pull());
  flash(5 * GST_SECOND + 40 * GST_MSECOND);
  expect_interval(5 * GST_SECOND, 5 * GST_SECOND + 40 * GST_MSECOND);
}

TEST_P(EverySimulator, TimesFramesWithoutPtsByTheFramerate) {
  gst_harness_set_live(h.get(), FALSE);
  h.caps(video);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(flash(GST_CLOCK_TIME_NONE), GST_FLOW_OK);
  h.wait_for_events();
  expect_interval(0, 40 * GST_MSECOND);
  expect_interval(40 * GST_MSECOND, 80 * GST_MSECOND);
  flash(200 * GST_MSECOND);  // the others continue from the last frame with a PTS
  flash(GST_CLOCK_TIME_NONE);
  h.wait_for_events();
  expect_interval(80 * GST_MSECOND, 200 * GST_MSECOND);
  expect_interval(200 * GST_MSECOND, 240 * GST_MSECOND);
  EXPECT_NE(h.warning().find("no timestamps"), std::string::npos);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, TimesFramesWithoutPtsByTheSegmentAfterASeek) {
  gst_harness_set_live(h.get(), FALSE);
  h.caps(video);
  flash(GST_CLOCK_TIME_NONE);
  flush({h.get()});
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 5 * GST_SECOND;
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  flash(GST_CLOCK_TIME_NONE);
  flash(GST_CLOCK_TIME_NONE);
  h.wait_for_events();
  expect_interval(5 * GST_SECOND, 5 * GST_SECOND + 40 * GST_MSECOND);
}

TEST_P(EverySimulator, TimesFramesOfALiveSourceWithoutPtsByTheClock) {
  h.caps(uneven);
  for (const auto now : {7, 50, 81}) {
    gst_harness_set_time(h.get(), static_cast<GstClockTime>(now) * GST_MSECOND);
    EXPECT_EQ(flash(GST_CLOCK_TIME_NONE), GST_FLOW_OK);
  }
  expect_interval(7 * GST_MSECOND, 50 * GST_MSECOND);
  expect_interval(50 * GST_MSECOND, 81 * GST_MSECOND);
  EXPECT_NE(h.warning().find("arrival"), std::string::npos);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, TimesTheFramesOfASourceOfBytes) {
  gst_harness_set_live(h.get(), FALSE);
  h.caps(video);
  GstSegment bytes;
  gst_segment_init(&bytes, GST_FORMAT_BYTES);
  gst_harness_push_event(h.get(), gst_event_new_segment(&bytes));
  flash(GST_CLOCK_TIME_NONE);
  flash(GST_CLOCK_TIME_NONE);
  h.wait_for_events();
  expect_interval(0, 40 * GST_MSECOND);
  Owned<GstEvent> last;
  while (Owned<GstEvent> event = h.pull_event(GST_EVENT_SEGMENT)) last = std::move(event);
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(last.get(), &segment);
  EXPECT_EQ(segment->format, GST_FORMAT_TIME);
}

TEST_P(EverySimulator, WarnsOnceWhereNothingTellsTheTimesOfFrames) {
  gst_harness_set_live(h.get(), FALSE);
  h.caps(uneven);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(flash(GST_CLOCK_TIME_NONE), GST_FLOW_OK);
  EXPECT_FALSE(h.pull());
  EXPECT_NE(h.warning().find("framerate in its caps"), std::string::npos);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, WarnsOfTimeThatRunsBackwards) {
  h.caps(video);
  flash(100 * GST_MSECOND);
  EXPECT_EQ(flash(60 * GST_MSECOND), GST_FLOW_OK);
  EXPECT_FALSE(h.pull());
  flash(140 * GST_MSECOND);
  expect_interval(60 * GST_MSECOND, 140 * GST_MSECOND);
  EXPECT_NE(h.warning().find("not later"), std::string::npos);
}

/// As from decoders, where the timestamps of a file are not in the order of its frames.
TEST_P(EverySimulator, SpacesFramesOfTheSameTimestamp) {
  h.caps(video);
  for (const auto pts : {0, 40, 40, 80, 80, 80, 80}) flash(pts * GST_MSECOND);
  flash(240 * GST_MSECOND);
  flash(240 * GST_MSECOND + 1);  // less than a microsecond later
  for (int i = 0; i < 3; ++i) {  // a stream of them
    GstBuffer* const frame = h.flat(0, i % 2 * 100);
    GST_BUFFER_DURATION(frame) = 30 * GST_MSECOND;
    GST_BUFFER_FLAG_SET(frame, i == 0 ? GST_BUFFER_FLAG_DISCONT : 0);
    h.push(frame);
  }
  const GstClockTime times[] = {0, 40, 60, 80, 100, 140, 180, 240, 260};
  for (std::size_t i = 1; i < std::size(times); ++i)
    expect_interval(times[i - 1] * GST_MSECOND, times[i] * GST_MSECOND);
  expect_interval(0, 30 * GST_MSECOND);
  expect_interval(30 * GST_MSECOND, 60 * GST_MSECOND);
  EXPECT_NE(h.warning().find("the same one"), std::string::npos);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulator, TakesNoIntervalShorterThanTheResolutionOfEvents) {
  h.caps(uneven);
  flash(1500);
  EXPECT_EQ(flash(2300), GST_FLOW_OK);
  EXPECT_FALSE(h.pull());
  EXPECT_NE(h.warning().find("less than a microsecond apart"), std::string::npos);
  flash(3300);
  expect_interval(2300, 3300);
}

TEST_P(EverySimulator, LetsNoIntervalsOverlap) {
  h.caps(video);
  flash(0);
  flash(100 * GST_MSECOND);
  expect_interval(0, 100 * GST_MSECOND);
  flash(60 * GST_MSECOND);  // neither starts an interval
  flash(90 * GST_MSECOND);
  flash(140 * GST_MSECOND);
  EXPECT_FALSE(h.pull());
  flash(180 * GST_MSECOND);
  expect_interval(140 * GST_MSECOND, 180 * GST_MSECOND);
  flash(0, GST_BUFFER_FLAG_DISCONT);  // time starts over
  flash(40 * GST_MSECOND);
  expect_interval(0, 40 * GST_MSECOND);
}

TEST_P(EverySimulator, CutsIntervalsThatEventsCannotCount) {
  h.caps(uneven);
  flash(0);
  const GstClockTime max_interval = GstClockTime{0xffffffff} * 1000;
  flash(max_interval);
  expect_interval(0, max_interval);
  flash(2 * max_interval + 1);
  EXPECT_FALSE(h.pull());
  EXPECT_TRUE(h.message(GST_MESSAGE_WARNING));
}

TEST_P(EverySimulator, HoldsTheLastFrameThroughAGapOfTheVideo) {
  h.caps(video);
  gst_harness_push_event(h.get(), gst_event_new_gap(0, 10 * GST_MSECOND));
  EXPECT_TRUE(h.pull_event(GST_EVENT_GAP));  // no interval has started: forwarded unchanged
  flash(10 * GST_MSECOND);
  gst_harness_push_event(h.get(), gst_event_new_gap(50 * GST_MSECOND, 100 * GST_MSECOND));
  flash(150 * GST_MSECOND);
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  const auto [start, duration] = gap_of(gap.get());
  EXPECT_EQ(start, 10 * GST_MSECOND);
  // The gap ends at 150 ms; a frame's length before that, the next interval begins.
  EXPECT_EQ(start + duration, 110 * GST_MSECOND);
  expect_interval(110 * GST_MSECOND, 150 * GST_MSECOND);
}

/// As at pauses of videos with B-frames: a demuxer's GAP is forwarded at once by a decoder that
/// still holds frames of before the gap, and of its end.
TEST_P(EverySimulator, LosesNoFrameThatAGapOvertook) {
  h.caps(video);
  const GstClockTime times[] = {0, 40, 80, 120, 2040, 2080, 2120, 2160};
  flash(0);
  flash(40 * GST_MSECOND);
  gst_harness_push_event(h.get(), gst_event_new_gap(120 * GST_MSECOND, 2000 * GST_MSECOND));
  for (const auto time : std::span(times).subspan(2)) flash(time * GST_MSECOND);
  for (std::size_t i = 1; i < std::size(times); ++i)
    expect_interval(times[i - 1] * GST_MSECOND, times[i] * GST_MSECOND);
  EXPECT_FALSE(h.pull());
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulatorAlone, ContinuesAnIntervalThroughRepeatedFrames) {
  h.caps(video);
  flash(0);
  repeat(40 * GST_MSECOND);
  flash(80 * GST_MSECOND);
  expect_interval(0, 80 * GST_MSECOND);
  GstBuffer* const frame = h.flat(120 * GST_MSECOND, 0);  // darker than any mean of frames
  h.push(gst_buffer_ref(frame));
  expect_interval(80 * GST_MSECOND, 120 * GST_MSECOND);
  GstBuffer* const again = gst_buffer_copy(frame);  // as imagefreeze sends its picture
  gst_buffer_unref(frame);
  GST_BUFFER_PTS(again) = 160 * GST_MSECOND;
  h.push(again);
  EXPECT_FALSE(h.pull());
  flash(200 * GST_MSECOND);
  expect_interval(120 * GST_MSECOND, 200 * GST_MSECOND);
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 2U);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulatorAlone, DrawsTheLastPictureForRepeatedFrames) {
  h.caps(video, pictures_of(GetParam()));
  flash(0);
  const auto empty = bytes_of(h.pull().get());
  flash(40 * GST_MSECOND);
  const auto picture = bytes_of(h.pull().get());
  EXPECT_FALSE(picture == empty);
  repeat(80 * GST_MSECOND);
  const auto repeated = h.pull();
  ASSERT_TRUE(repeated);
  EXPECT_EQ(GST_BUFFER_PTS(repeated.get()), 80 * GST_MSECOND);
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(repeated.get()));
  EXPECT_TRUE(bytes_of(repeated.get()) == picture);
  h.push(h.flat(120 * GST_MSECOND, 50));  // as at 40 ms, in other memory: the scene is still
  EXPECT_TRUE(h.pull());
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 1U);
}

TEST_P(EverySimulatorAlone, TakesAPictureThatIsRepeatedForASecondForAStillScene) {
  h.caps(video);
  flash(0);
  for (int i = 1; i <= 30; ++i) repeat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND);
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 25U);
}

TEST_P(EverySimulator, ComparesFramesOnlyIfItShould) {
  for (const bool compares : {false, true}) {
    Harness other(GetParam());
    g_object_set(other.element(), "skip-repeated", compares, nullptr);
    other.caps(video);
    const int greys[] = {50, 200, 200, 50, 50, 50, 200};
    for (std::size_t i = 0; i < std::size(greys); ++i)
      other.push(other.flat(i * 40 * GST_MSECOND, greys[i]));
    other.wait_for_events();
    std::vector<GstClockTime> starts;
    while (const auto events = other.pull())
      starts.push_back(GST_BUFFER_PTS(events.get()) / GST_MSECOND);
    while (const auto gap = other.pull_event(GST_EVENT_GAP))
      starts.push_back(gap_of(gap.get()).start / GST_MSECOND);
    std::ranges::sort(starts);
    // The second of three equal frames is a repetition, the third one tells that nothing moves.
    const std::vector<GstClockTime> expected =
        compares ? std::vector<GstClockTime>{0, 40, 120, 200}
                 : std::vector<GstClockTime>{0, 40, 80, 120, 160, 200};
    EXPECT_EQ(starts, expected);
    EXPECT_EQ(stat_of(other.element(), "repeated-frames"), compares ? 2U : 0U);
  }
}

/// As from matroskademux, after the first frame of files with sound.
TEST_P(EverySimulator, GoesOnInASegmentOfTheSameRunningTimes) {
  h.caps(video);
  flash(23 * GST_MSECOND);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = segment.base = 23 * GST_MSECOND;
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  flash(63 * GST_MSECOND);
  expect_interval(23 * GST_MSECOND, 63 * GST_MSECOND);
  segment.base += GST_SECOND;
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  flash(103 * GST_MSECOND);
  EXPECT_FALSE(h.pull());
}

TEST_P(EverySimulator, GoesOnAfterAGapInVideoOfAnyFramerate) {
  h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=0/1");
  flash(0);
  gst_harness_push_event(h.get(), gst_event_new_gap(40 * GST_MSECOND, 80 * GST_MSECOND));
  flash(120 * GST_MSECOND);
  EXPECT_EQ(h.warning(), "");
  const auto events = h.pull();
  ASSERT_TRUE(events);
  EXPECT_EQ(GST_BUFFER_PTS(events.get()) + GST_BUFFER_DURATION(events.get()), 120 * GST_MSECOND);
}

TEST_P(EverySimulator, RefusesToRunBackwards) {
  h.caps(video);
  flash(0);
  play_backwards(h);
  EXPECT_NE(h.error().find("backwards"), std::string::npos);
  EXPECT_EQ(flash(40 * GST_MSECOND), GST_FLOW_ERROR);
  EXPECT_EQ(flash(80 * GST_MSECOND), GST_FLOW_ERROR);
  EXPECT_EQ(h.error(), "");  // one is enough
  push_segment(h.get());
  EXPECT_EQ(flash(120 * GST_MSECOND), GST_FLOW_OK);
}

/// A bright square that moves down by a pixel a frame.
void push_square(Harness& h, int frame, GstClockTime pts, guint flags = 0) {
  GstBuffer* buffer = h.frame(pts, [frame](int x, int y) {
    return x >= 6 && x < 20 && y >= frame && y < frame + 16 ? 210 : 40;
  });
  GST_BUFFER_FLAG_SET(buffer, flags);
  EXPECT_EQ(h.push(buffer), GST_FLOW_OK);
}

/// A video, and what happens to it.
struct Script {
  const char* name;
  void (*run)(Harness& h);
  bool loses_rows = false;  ///< which are later than the next frame
};

const Script scripts[] = {
    {"even frames",
     [](Harness& h) {
       for (int i = 0; i < 6; ++i) push_square(h, i, i * 40 * GST_MSECOND);
     }},
    {"short intervals",
     [](Harness& h) {
       for (int i = 0; i < 8; ++i) push_square(h, i, i * 5 * GST_MSECOND);
     }},
    {"a gap",
     [](Harness& h) {
       for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
       gst_harness_push_event(h.get(), gst_event_new_gap(120 * GST_MSECOND, 900 * GST_MSECOND));
       for (int i = 3; i < 5; ++i) push_square(h, i, (900 + i * 40) * GST_MSECOND);
     }},
    {"a discontinuity",
     [](Harness& h) {
       for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
       for (int i = 3; i < 5; ++i)
         push_square(h, i, (i * 40 + 300) * GST_MSECOND, i == 3 ? GST_BUFFER_FLAG_DISCONT : 0);
     }},
    {"a discontinuity before the last row",
     [](Harness& h) {
       for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
       for (int i = 3; i < 5; ++i)
         push_square(h, i, (i * 40 - 25) * GST_MSECOND, i == 3 ? GST_BUFFER_FLAG_DISCONT : 0);
     },
     true},
    {"another size",
     [](Harness& h) {
       for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
       h.caps("video/x-raw, format=GRAY8, width=40, height=24, framerate=25/1");
       for (int i = 3; i < 5; ++i) push_square(h, i, i * 40 * GST_MSECOND);
     }},
    {"another stream",
     [](Harness& h) {
       for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
       gst_harness_push_event(h.get(), gst_event_new_stream_start("another"));
       GstSegment segment;
       gst_segment_init(&segment, GST_FORMAT_TIME);
       gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
       for (int i = 3; i < 5; ++i) push_square(h, i, (i * 40 + 100) * GST_MSECOND);
     }},
};

TEST_P(EverySimulatorAlone, DelaysTheRowsOfARollingShutter) {
  using Event = std::tuple<GstClockTime, guint, guint16, guint16>;  // time, row, column, polarity
  const auto events_with = [](gint64 shutter, const Script& script) {
    Harness simulator(gst_harness_new_parse(GetParam()), GetParam());
    g_object_set(simulator.element(), "rolling-shutter", shutter, nullptr);
    simulator.caps(video);
    script.run(simulator);
    gst_harness_push_event(simulator.get(), gst_event_new_eos());
    EXPECT_TRUE(simulator.pull_event(GST_EVENT_EOS));
    std::vector<Event> events;
    GstClockTime end = 0;
    while (const auto buffer = simulator.pull()) {
      const GstClockTime start = GST_BUFFER_PTS(buffer.get());
      EXPECT_GE(start, end) << script.name;
      end = start + GST_BUFFER_DURATION(buffer.get());
      for (const auto& event : events_of(buffer.get())) {
        EXPECT_LE(event.t, (end - start) / 1000) << script.name;
        events.emplace_back(start / 1000 + event.t, gst_event_camera_event_get_y(&event), event.x,
                            event.y_p);
      }
    }
    return events;
  };
  constexpr gint64 shutter = 23 * GST_MSECOND;  // of 24 rows
  for (const auto& script : scripts) {
    const auto global = events_with(0, script);
    ASSERT_FALSE(global.empty());
    for (const bool is_from_top : {true, false}) {
      auto expected = global;
      for (auto& [t, y, x, y_p] : expected) t += (is_from_top ? y : 23 - y) * 1000;
      std::ranges::sort(expected);
      const auto events = events_with(is_from_top ? shutter : -shutter, script);
      if (script.loses_rows) {
        EXPECT_TRUE(std::ranges::includes(expected, events)) << script.name;
        EXPECT_GT(events.size(), expected.size() / 2) << script.name;
      } else {
        EXPECT_EQ(events, expected) << script.name;
      }
    }
  }
}

TEST_P(EverySimulator, DropsLateRowsInAFlush) {
  g_object_set(h.element(), "rolling-shutter", gint64{23 * GST_MSECOND}, nullptr);
  h.caps(video);
  for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * GST_MSECOND);
  while (h.pull()) continue;
  flush({h.get()});
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  for (int i = 0; i < 2; ++i) h.push(h.flat(i * 40 * GST_MSECOND, 60));
  gst_harness_push_event(h.get(), gst_event_new_eos());
  EXPECT_FALSE(h.pull());
}

TEST_P(EverySimulator, DrawsTheRowsOfItsFramesWhateverTheShutter) {
  const auto pictures_with = [](gint64 shutter) {
    Harness simulator(GetParam());
    g_object_set(simulator.element(), "rolling-shutter", shutter, nullptr);
    simulator.caps(video, pictures_of(GetParam()));
    std::vector<std::string> pictures;
    for (int i = 0; i < 4; ++i) {
      push_square(simulator, i, i * 40 * GST_MSECOND);
      pictures.push_back(bytes_of(simulator.pull().get()));
    }
    return pictures;
  };
  EXPECT_EQ(pictures_with(23 * GST_MSECOND), pictures_with(0));
}

TEST_P(EverySimulator, IsNotLaterWithARollingShutter) {
  g_object_set(h.element(), "rolling-shutter", gint64{23 * GST_MSECOND}, nullptr);
  h.caps(video);
  gst_harness_set_upstream_latency(h.get(), 5 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 45 * GST_MSECOND);
}

TEST_P(EverySimulator, IsOneFrameLate) {
  h.caps(video);
  EXPECT_TRUE(h.message(GST_MESSAGE_LATENCY));
  gst_harness_set_upstream_latency(h.get(), 5 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 45 * GST_MSECOND);
  h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=50/1");
  EXPECT_TRUE(h.message(GST_MESSAGE_LATENCY));
  EXPECT_EQ(gst_harness_query_latency(h.get()), 25 * GST_MSECOND);
}

TEST_P(EverySimulator, LearnsThatFramesComeSlowerThanTheCapsSay) {
  h.caps(video);
  flash(0);
  flash(40 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 40 * GST_MSECOND);
  flash(120 * GST_MSECOND);
  flash(200 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 80 * GST_MSECOND);
}

TEST_P(EverySimulator, DoesNotDelayTheViewAfterOnePause) {
  h.caps(video);
  h.message(GST_MESSAGE_LATENCY);
  GstClockTime time = 0;
  for (int i = 0; i < 10; ++i) flash(time += 40 * GST_MSECOND);
  time += 800 * GST_MSECOND;
  for (int i = 0; i < 30; ++i) {
    flash(time += 40 * GST_MSECOND);
    EXPECT_EQ(gst_harness_query_latency(h.get()), 40 * GST_MSECOND);
  }
  EXPECT_FALSE(h.message(GST_MESSAGE_LATENCY));
}

TEST_P(EverySimulator, ReturnsToItsLatencyWithinASecond) {
  h.caps(video);
  GstClockTime time = 0;
  for (int i = 0; i < 4; ++i) flash(time += 300 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 300 * GST_MSECOND);
  while (h.message(GST_MESSAGE_LATENCY)) {
  }
  for (int i = 0; i < 25; ++i) flash(time += 40 * GST_MSECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 40 * GST_MSECOND);
  EXPECT_TRUE(h.message(GST_MESSAGE_LATENCY));
  EXPECT_FALSE(h.message(GST_MESSAGE_LATENCY));
}

TEST_P(EverySimulator, KeepsLatenessFromUpstream) {
  h.caps(video);
  flash(0);
  gst_harness_push_upstream_event(
      h.get(), gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, 80 * GST_MSECOND, 0));
  while (GstEvent* event = gst_harness_try_pull_upstream_event(h.get())) {
    EXPECT_NE(GST_EVENT_TYPE(event), GST_EVENT_QOS);
    gst_event_unref(event);
  }
}

TEST_P(EverySimulator, LearnsItsLatencyWhereTheFramerateVaries) {
  h.caps(uneven);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 0U);
  flash(0);
  flash(30 * GST_MSECOND);
  EXPECT_TRUE(h.message(GST_MESSAGE_LATENCY));
  EXPECT_EQ(gst_harness_query_latency(h.get()), 30 * GST_MSECOND);
  flash(50 * GST_MSECOND);
  EXPECT_FALSE(h.message(GST_MESSAGE_LATENCY));
  flash(10 * GST_SECOND);
  flash(20 * GST_SECOND);
  EXPECT_EQ(gst_harness_query_latency(h.get()), GST_SECOND);
}

TEST(Dvs, SendsTheNoiseOfAGap) {
  for (const std::string element : {"eventsim-dvs", "gleventsim-dvs"}) {
    Harness h(element + " leak-rate=100");
    h.caps(video);
    h.push(h.flat(0, 90));
    gst_harness_push_event(h.get(), gst_event_new_gap(40 * GST_MSECOND, 100 * GST_MSECOND));
    h.push(h.flat(140 * GST_MSECOND, 90));
    const auto held = h.pull();  // up to a frame's length before the end of the gap
    ASSERT_TRUE(held);
    EXPECT_EQ(GST_BUFFER_PTS(held.get()), 0U);
    EXPECT_EQ(GST_BUFFER_DURATION(held.get()), 100 * GST_MSECOND);
    EXPECT_EQ(events_of(held.get()).size(), 32U * 24U * 10U);
    const auto next = h.pull();
    ASSERT_TRUE(next);
    EXPECT_EQ(GST_BUFFER_PTS(next.get()), 100 * GST_MSECOND);
    EXPECT_EQ(GST_BUFFER_DURATION(next.get()), 40 * GST_MSECOND);
  }
}

TEST(Dvs, SendsTheNoiseOfAPictureThatIsRepeated) {
  Harness h("eventsim-dvs leak-rate=100");
  h.caps(video);
  for (int i = 0; i <= 50; ++i) {
    GstBuffer* frame = h.flat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, 90);
    GST_BUFFER_FLAG_SET(frame, i % 10 > 0 ? GST_BUFFER_FLAG_GAP : 0);
    h.push(frame);
  }
  gst_harness_push_event(h.get(), gst_event_new_eos());
  std::size_t events = 0;
  while (const auto interval = h.pull()) events += events_of(interval.get()).size();
  EXPECT_NEAR(static_cast<double>(events), 32 * 24 * 200.0, 32 * 24);
}

TEST(Dvs, SendsTheNoiseOfTheFirstMinuteOfAGap) {
  const std::pair<int, double> gaps[] = {{10, 100}, {7200, 10}};  // seconds, events per second
  for (const auto& [seconds, rate] : gaps) {
    Harness h("eventsim-dvs leak-rate=" + std::to_string(rate));
    h.caps(video);
    h.push(h.flat(0, 90));
    const auto end = static_cast<GstClockTime>(seconds) * GST_SECOND;
    gst_harness_push_event(h.get(), gst_event_new_gap(0, end));
    gst_harness_push_event(h.get(), gst_event_new_eos());
    double events = 0;
    GstClockTime until = 0;
    while (const auto held = h.pull()) {
      EXPECT_GE(GST_BUFFER_PTS(held.get()), until);
      until = GST_BUFFER_PTS(held.get()) + GST_BUFFER_DURATION(held.get());
      events += static_cast<double>(events_of(held.get()).size());
    }
    EXPECT_LE(until, std::min<GstClockTime>(end, 60 * GST_SECOND));
    EXPECT_NEAR(events, 32 * 24 * (std::min(seconds, 60) - 0.04) * rate, 32 * 24);
    EXPECT_EQ(h.warning().find("pauses for more than a minute") != std::string::npos, seconds > 60);
    Gap rest;
    while (const auto gap = h.pull_event(GST_EVENT_GAP)) rest = gap_of(gap.get());
    if (seconds > 60) {
      EXPECT_EQ(rest.start + rest.duration, end - 40 * GST_MSECOND);
    }
  }
}

}  // namespace
