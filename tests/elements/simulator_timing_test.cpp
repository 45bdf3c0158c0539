// SPDX-License-Identifier: LGPL-2.1-or-later
// Times and order of intervals, and discontinuities between frames.
#include <algorithm>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "tests/elements/event_buffer.hpp"

namespace {

using namespace harness;
using eventcamera::AbsoluteEvent;
using eventcamera::Microseconds;

constexpr GstClockTime ms = GST_MSECOND;
constexpr GstClockTime none = GST_CLOCK_TIME_NONE;
constexpr GstClockTime max_interval = GstClockTime{0xffffffff} * 1000;
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
    bright = !bright;
    return flash(pts, GST_BUFFER_FLAG_GAP);
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

TEST_P(EverySimulator, DrawsAPictureForEveryFrameAtItsTime) {
  h.caps(video, pictures_of(GetParam()));
  std::vector<std::string> pictures;
  for (int i = 0; i < 6; ++i) {
    GstBuffer* frame = h.flat(static_cast<GstClockTime>(i) * 40 * ms, i < 3 ? 60 : 200);
    GST_BUFFER_DURATION(frame) = 39 * ms;
    if (i == 5) GST_BUFFER_FLAG_SET(frame, GST_BUFFER_FLAG_DISCONT);
    h.push(frame);
    const auto picture = h.pull();
    ASSERT_TRUE(picture) << i;
    EXPECT_EQ(GST_BUFFER_PTS(picture.get()), i * 40 * ms);
    EXPECT_EQ(GST_BUFFER_DURATION(picture.get()), 39 * ms);
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

struct Timing {
  const char* of;
  std::string caps;
  bool live;
  std::vector<GstClockTime> frames;
  std::vector<std::pair<GstClockTime, GstClockTime>> intervals;
  std::string warning;  ///< part of the only one; empty for none
};

const Timing timings[] = {
    {"a framerate, from the last PTS on",
     video,
     false,
     {none, none, none, 200 * ms, none},
     {{0, 40 * ms}, {40 * ms, 80 * ms}, {80 * ms, 200 * ms}, {200 * ms, 240 * ms}},
     "no timestamps"},
    {"nothing", uneven, false, {none, none, none}, {}, "framerate in its caps"},
    {"time that runs backwards",
     video,
     true,
     {100 * ms, 60 * ms, 140 * ms},
     {{60 * ms, 140 * ms}},
     "not later"},
    {"late frames, which start no interval",
     video,
     true,
     {0, 100 * ms, 60 * ms, 90 * ms, 140 * ms, 180 * ms},
     {{0, 100 * ms}, {140 * ms, 180 * ms}},
     "not later"},
    {"frames of one timestamp, as from decoders of files whose times are not in order",
     video,
     true,
     {0, 40 * ms, 40 * ms, 80 * ms, 80 * ms, 80 * ms, 80 * ms, 240 * ms, 240 * ms + 1},
     {{0, 40 * ms},
      {40 * ms, 60 * ms},
      {60 * ms, 80 * ms},
      {80 * ms, 100 * ms},
      {100 * ms, 140 * ms},
      {140 * ms, 180 * ms},
      {180 * ms, 240 * ms},
      {240 * ms, 260 * ms}},
     "the same one"},
    {"less than the resolution of events",
     uneven,
     true,
     {1500, 2300, 3300},
     {{2300, 3300}},
     "less than a microsecond apart"},
    {"more than events can count",
     uneven,
     true,
     {0, max_interval, 2 * max_interval + 1},
     {{0, max_interval}},
     "s"},
};

TEST_P(EverySimulator, TimesFrames) {
  for (const auto& timing : timings) {
    Harness simulator(GetParam());
    gst_harness_set_live(simulator.get(), timing.live);
    simulator.caps(timing.caps);
    for (std::size_t i = 0; i < timing.frames.size(); ++i)
      EXPECT_EQ(simulator.push(simulator.flat(timing.frames[i], i % 2 * 150)), GST_FLOW_OK);
    simulator.wait_for_events();
    std::vector<std::pair<GstClockTime, GstClockTime>> intervals;
    while (const auto buffer = simulator.pull())
      intervals.emplace_back(GST_BUFFER_PTS(buffer.get()),
                             GST_BUFFER_PTS(buffer.get()) + GST_BUFFER_DURATION(buffer.get()));
    EXPECT_EQ(intervals, timing.intervals) << timing.of;
    EXPECT_TRUE(contains(simulator.warning(), timing.warning)) << timing.of;
    EXPECT_EQ(simulator.warning(), "") << timing.of;
  }
}

TEST_P(EverySimulator, TimesFramesOfALiveSourceWithoutPtsByTheClock) {
  h.caps(uneven);
  for (const auto now : {7, 50, 81}) {
    gst_harness_set_time(h.get(), static_cast<GstClockTime>(now) * ms);
    EXPECT_EQ(flash(none), GST_FLOW_OK);
  }
  expect_interval(7 * ms, 50 * ms);
  expect_interval(50 * ms, 81 * ms);
  EXPECT_TRUE(contains(h.warning(), "arrival"));
}

TEST_P(EverySimulator, BeginsAnewAfterADiscontinuity) {
  h.caps(video);
  flash(0);
  flash(40 * ms);
  expect_interval(0, 40 * ms);
  flash(80 * ms, GST_BUFFER_FLAG_DISCONT);
  EXPECT_FALSE(h.pull());
  flash(120 * ms);
  const auto buffer = h.pull();
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), 80 * ms);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(buffer.get()));
  flash(160 * ms);
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
      GstBuffer* frame = bare.flat(static_cast<GstClockTime>(i) * 40 * ms, i % 2 * 150);
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
  push_segment(h.get());
  flash(40 * ms);
  expect_interval(0, 40 * ms);
  // As from matroskademux, after the first frame of files with sound.
  push_segment(h.get(), {.start = 40 * ms, .time = 40 * ms, .base = 40 * ms});
  flash(80 * ms);
  expect_interval(40 * ms, 80 * ms);
  push_segment(h.get(), {.start = 5 * GST_SECOND, .time = 5 * GST_SECOND, .base = 40 * ms});
  gst_harness_set_live(h.get(), FALSE);
  flash(none);  // at the start of the segment
  EXPECT_FALSE(h.pull());
  flash(5 * GST_SECOND + 40 * ms);
  expect_interval(5 * GST_SECOND, 5 * GST_SECOND + 40 * ms);
}

TEST_P(EverySimulator, HoldsTheLastFrameThroughAGapOfTheVideo) {
  h.caps(video);
  push_gap(h.get(), 0, 10 * ms);
  EXPECT_TRUE(h.pull_event(GST_EVENT_GAP));  // no interval has started: forwarded unchanged
  flash(10 * ms);
  push_gap(h.get(), 50 * ms, 100 * ms);
  flash(150 * ms);
  const auto gap = h.pull_event(GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  const auto [start, duration] = gap_of(gap.get());
  EXPECT_EQ(start, 10 * ms);
  // The gap ends at 150 ms; a frame's length before that, the next interval begins.
  EXPECT_EQ(start + duration, 110 * ms);
  expect_interval(110 * ms, 150 * ms);
}

/// As at pauses of videos with B-frames: a demuxer's GAP is forwarded at once by a decoder that
/// still holds frames of before the gap, and of its end.
TEST_P(EverySimulator, LosesNoFrameThatAGapOvertook) {
  h.caps(uneven);
  const GstClockTime times[] = {0, 40, 80, 120, 2040, 2080};
  flash(0);
  flash(40 * ms);
  push_gap(h.get(), 120 * ms, 2000 * ms);
  for (const auto time : std::span(times).subspan(2)) flash(time * ms);
  for (std::size_t i = 1; i < std::size(times); ++i)
    expect_interval(times[i - 1] * ms, times[i] * ms);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulatorAlone, ContinuesAnIntervalThroughRepeatedFrames) {
  h.caps(video);
  flash(0);
  repeat(40 * ms);
  flash(80 * ms);
  expect_interval(0, 80 * ms);
  GstBuffer* const frame = h.flat(120 * ms, 0);  // darker than any mean of frames
  h.push(gst_buffer_ref(frame));
  expect_interval(80 * ms, 120 * ms);
  GstBuffer* const again = gst_buffer_copy(frame);  // as imagefreeze sends its picture
  gst_buffer_unref(frame);
  GST_BUFFER_PTS(again) = 160 * ms;
  h.push(again);
  EXPECT_FALSE(h.pull());
  flash(200 * ms);
  expect_interval(120 * ms, 200 * ms);
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 2U);
  EXPECT_EQ(h.warning(), "");
}

TEST_P(EverySimulatorAlone, DrawsTheLastPictureForRepeatedFrames) {
  h.caps(video, pictures_of(GetParam()));
  flash(0);
  const auto empty = bytes_of(h.pull().get());
  flash(40 * ms);
  const auto picture = bytes_of(h.pull().get());
  EXPECT_FALSE(picture == empty);
  repeat(80 * ms);
  const auto repeated = h.pull();
  ASSERT_TRUE(repeated);
  EXPECT_EQ(GST_BUFFER_PTS(repeated.get()), 80 * ms);
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(repeated.get()));
  EXPECT_TRUE(bytes_of(repeated.get()) == picture);
  h.push(h.flat(120 * ms, 50));  // as at 40 ms, in other memory: the scene is still
  EXPECT_TRUE(h.pull());
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 1U);
}

TEST_P(EverySimulatorAlone, TakesAPictureThatIsRepeatedForASecondForAStillScene) {
  h.caps(video);
  flash(0);
  for (int i = 1; i <= 30; ++i) repeat(static_cast<GstClockTime>(i) * 40 * ms);
  EXPECT_EQ(stat_of(h.element(), "repeated-frames"), 25U);
}

TEST_P(EverySimulator, ComparesFramesOnlyIfItShould) {
  for (const bool compares : {false, true}) {
    Harness other(GetParam());
    g_object_set(other.element(), "skip-repeated", compares, nullptr);
    other.caps(video);
    const int greys[] = {50, 200, 200, 50, 50, 50, 200};
    for (std::size_t i = 0; i < std::size(greys); ++i)
      other.push(other.flat(i * 40 * ms, greys[i]));
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

/// A bright square that moves down by a pixel a frame.
void push_square(Harness& h, int frame, GstClockTime pts, guint flags = 0) {
  GstBuffer* buffer = h.frame(pts, [frame](int x, int y) {
    return x >= 6 && x < 20 && y >= frame && y < frame + 16 ? 210 : 40;
  });
  GST_BUFFER_FLAG_SET(buffer, flags);
  EXPECT_EQ(h.push(buffer), GST_FLOW_OK);
}

/// What happens after three frames, and when the next ones come.
struct Break {
  const char* name;
  int shift = 0;  ///< ms
  guint flags = 0;
  void (*happen)(Harness& h) = [](Harness&) {};
};

const Break breaks[] = {
    {"nothing"},
    {"a gap", 900, 0, [](Harness& h) { push_gap(h.get(), 120 * ms, 900 * ms); }},
    {"a discontinuity before the last row", -25, GST_BUFFER_FLAG_DISCONT},
    {"another size", 0, 0,
     [](Harness& h) { h.caps("video/x-raw, format=GRAY8, width=40, height=24, framerate=25/1"); }},
};

TEST_P(EverySimulatorAlone, DelaysTheRowsOfARollingShutter) {
  const auto events_with = [](gint64 shutter, const Break& after) {
    Harness simulator(gst_harness_new_parse(GetParam()), GetParam());
    g_object_set(simulator.element(), "rolling-shutter", shutter, nullptr);
    simulator.caps(video);
    for (int i = 0; i < 3; ++i) push_square(simulator, i, i * 40 * ms);
    after.happen(simulator);
    for (int i = 3; i < 5; ++i)
      push_square(simulator, i, static_cast<GstClockTime>(i * 40 + after.shift) * ms,
                  i == 3 ? after.flags : 0);
    push_eos(simulator.get());
    std::vector<AbsoluteEvent> events;
    GstClockTime end = 0;
    for (const auto& buffer : pull_until_eos(simulator.get())) {
      EXPECT_GE(GST_BUFFER_PTS(buffer.get()), end) << after.name;
      end = GST_BUFFER_PTS(buffer.get()) + GST_BUFFER_DURATION(buffer.get());
      append_events(buffer.get(), events);
      EXPECT_LE(events.back().t, static_cast<Microseconds>(end / 1000)) << after.name;
    }
    return events;
  };
  const auto is_earlier = [](const AbsoluteEvent& a, const AbsoluteEvent& b) {
    return std::tuple(a.t, a.y(), a.x, a.y_p) < std::tuple(b.t, b.y(), b.x, b.y_p);
  };
  constexpr gint64 shutter = 23 * ms;  // of 24 rows
  for (const auto& after : breaks) {
    const auto global = events_with(0, after);
    ASSERT_FALSE(global.empty());
    for (const bool is_from_top : {true, false}) {
      auto expected = global;
      for (auto& event : expected) event.t += (is_from_top ? event.y() : 23 - event.y()) * 1000;
      std::ranges::sort(expected, is_earlier);
      const auto events = events_with(is_from_top ? shutter : -shutter, after);
      if (after.shift >= 0) {
        EXPECT_EQ(events, expected) << after.name;
        continue;
      }
      // Rows that would be later than the next frame are lost.
      EXPECT_TRUE(std::ranges::includes(expected, events, is_earlier));
      EXPECT_GT(events.size(), expected.size() / 2);
    }
  }
}

TEST_P(EverySimulator, DropsLateRowsInAFlush) {
  g_object_set(h.element(), "rolling-shutter", gint64{23 * ms}, nullptr);
  h.caps(video);
  for (int i = 0; i < 3; ++i) push_square(h, i, i * 40 * ms);
  while (h.pull()) continue;
  flush({h.get()});
  push_segment(h.get());
  for (int i = 0; i < 2; ++i) h.push(h.flat(i * 40 * ms, 60));
  push_eos(h.get());
  EXPECT_FALSE(h.pull());
}

struct Latency {
  std::string caps;
  std::vector<int> intervals;  ///< of frames, ms
  GstClockTime expected;
};

TEST_P(EverySimulator, IsAsLateAsFramesAreApart) {
  const std::vector<int> steady(25, 40);
  auto slow = std::vector{300, 300, 300};
  auto recovered = slow;
  recovered.insert(recovered.end(), steady.begin(), steady.end());
  for (const auto& [caps, intervals, expected] :
       {Latency{video, {}, 40 * ms}, Latency{video, {40}, 40 * ms},
        Latency{video, {40, 80, 80}, 80 * ms},  // slower than the caps say
        Latency{video, slow, 300 * ms}, Latency{video, recovered, 40 * ms},
        Latency{video, {40, 40, 840, 40, 40, 40}, 40 * ms},  // one pause
        Latency{uneven, {}, 0}, Latency{uneven, {30, 20}, 30 * ms},
        Latency{uneven, {10'000, 10'000}, 1000 * ms}}) {
    Harness simulator(GetParam());
    g_object_set(simulator.element(), "rolling-shutter", gint64{23 * ms}, nullptr);
    gst_harness_set_upstream_latency(simulator.get(), 5 * ms);
    simulator.caps(caps);
    GstClockTime time = 0;
    simulator.push(simulator.flat(0, 50));
    for (const auto interval : intervals)
      simulator.push(simulator.flat(time += static_cast<GstClockTime>(interval) * ms, 50));
    EXPECT_EQ(gst_harness_query_latency(simulator.get()), 5 * ms + expected)
        << caps << " " << testing::PrintToString(intervals);
    EXPECT_EQ(bool(simulator.message(GST_MESSAGE_LATENCY)), expected > 0);
  }
}

TEST_P(EverySimulator, DrawsWithoutLatency) {
  h.caps(video, pictures_of(GetParam()));
  gst_harness_set_upstream_latency(h.get(), 5 * ms);
  flash(0);
  flash(120 * ms);
  EXPECT_EQ(gst_harness_query_latency(h.get()), 5 * ms);
}

TEST_P(EverySimulator, KeepsLatenessFromUpstream) {
  h.caps(video);
  flash(0);
  gst_harness_push_upstream_event(h.get(),
                                  gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, 80 * ms, 0));
  while (const Owned<GstEvent> event{gst_harness_try_pull_upstream_event(h.get())})
    EXPECT_NE(GST_EVENT_TYPE(event.get()), GST_EVENT_QOS);
}

TEST(Dvs, SendsTheNoiseOfTheFirstMinuteOfAGap) {
  Harness h("eventsim-dvs leak-rate=10");
  h.caps(video);
  h.push(h.flat(0, 90));
  const GstClockTime end = 7200 * GST_SECOND;
  push_gap(h.get(), 0, end);
  push_eos(h.get());
  double events = 0;
  GstClockTime until = 0;
  while (const auto held = h.pull()) {
    EXPECT_GE(GST_BUFFER_PTS(held.get()), until);
    until = GST_BUFFER_PTS(held.get()) + GST_BUFFER_DURATION(held.get());
    events += static_cast<double>(events_of(held.get()).size());
  }
  EXPECT_LE(until, 60 * GST_SECOND);
  EXPECT_NEAR(events, 32 * 24 * (60 - 0.04) * 10, 32 * 24);
  EXPECT_TRUE(contains(h.warning(), "pauses for more than a minute"));
  Gap rest;
  while (const auto gap = h.pull_event(GST_EVENT_GAP)) rest = gap_of(gap.get());
  EXPECT_EQ(rest.start + rest.duration, end - 40 * ms);
}

TEST(Dvs, SendsTheNoiseOfAPictureThatIsRepeated) {
  Harness h("eventsim-dvs leak-rate=100");
  h.caps(video);
  for (int i = 0; i <= 50; ++i) {
    GstBuffer* frame = h.flat(static_cast<GstClockTime>(i) * 40 * ms, 90);
    GST_BUFFER_FLAG_SET(frame, i % 10 > 0 ? GST_BUFFER_FLAG_GAP : 0);
    h.push(frame);
  }
  push_eos(h.get());
  std::size_t events = 0;
  while (const auto interval = h.pull()) events += events_of(interval.get()).size();
  EXPECT_NEAR(static_cast<double>(events), 32 * 24 * 200.0, 32 * 24);
}

}  // namespace
