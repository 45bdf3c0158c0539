// SPDX-License-Identifier: LGPL-2.1-or-later
// eventmerge: which events come out, when and where, and intervals that follow each other.
#include <gst/app/gstappsrc.h>

#include <algorithm>

#include "src/core/label.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::AbsoluteEvent;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;
constexpr const char* small = "application/x-event-camera, format=XYTP, width=8, height=4";

using Events = std::vector<AbsoluteEvent>;

class MergeTest : public testing::Test {
 protected:
  MergeTest() : inputs_("eventmerge", "sink_0", "sink_1") {}

  void begin() {
    for (auto* h : inputs_.both()) gst_harness_set_src_caps_str(h, small);
  }

  GstHarness* a() { return inputs_.first.get(); }
  GstHarness* b() { return inputs_.second.get(); }
  GstElement* element() { return inputs_.element.get(); }

  static void push(GstHarness* to, GstClockTime pts, const std::vector<Event>& events,
                   GstClockTime duration = 10 * ms) {
    EXPECT_EQ(gst_harness_push(to, buffer_of(pts, events, duration)), GST_FLOW_OK);
  }
  void place_second(guint x, guint y) {
    g_object_set(static_pad(element(), "sink_1").get(), "xpos", x, "ypos", y, nullptr);
  }

  /// Events up to the end, after ending both inputs.
  Events rest() {
    inputs_.end();
    for (const auto& buffer : pull_until_eos(a())) take(buffer.get());
    return merged_;
  }

  /// Size in the caps of the next buffer, whose events are added to the output.
  std::string next_size() {
    const Buffer buffer(gst_harness_pull(a()));
    EXPECT_TRUE(buffer);
    if (buffer) take(buffer.get());
    return size_of(a());
  }

  /// Expects sorted events within intervals that follow each other.
  void take(GstBuffer* buffer) {
    EXPECT_GE(GST_BUFFER_PTS(buffer), end_);
    end_ = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
    for (const auto& event : events_of(buffer))
      EXPECT_LE(event.t * GST_USECOND, GST_BUFFER_DURATION(buffer));
    append_events(buffer, merged_);
    EXPECT_TRUE(std::ranges::is_sorted(merged_, {}, &AbsoluteEvent::t));
  }

  TwoInputs inputs_;
  Events merged_;

 private:
  GstClockTime end_ = 0;
};

TEST_F(MergeTest, SortsByTimeThenByPad) {
  begin();
  push(a(), 0, {on(1, 0, 0), on(2, 0, 5), on(3, 0, 7)});
  push(b(), 0, {on(4, 0, 0), on(5, 0, 6), on(6, 0, 7)});
  EXPECT_EQ(rest(), (Events{on_at(1, 0, 0), on_at(4, 0, 0), on_at(2, 0, 5), on_at(5, 0, 6),
                            on_at(3, 0, 7), on_at(6, 0, 7)}));
  EXPECT_EQ(stat_of(element(), "events"), 6U);
}

TEST_F(MergeTest, KeepsTimesThatAreNoWholeMicroseconds) {
  begin();
  push(a(), 1'999, {on(1, 0, 0), on(2, 0, 10)}, 10'001);
  push(b(), 2'500, {on(3, 0, 9)}, 9'900);
  push(a(), 20 * ms, {on(4, 0, 0)}, 0);
  EXPECT_EQ(rest(),
            (Events{on_at(1, 0, 1), on_at(2, 0, 11), on_at(3, 0, 11), on_at(4, 0, 20'000)}));
}

TEST_F(MergeTest, PutsSensorsSideBySide) {
  place_second(8, 1);
  begin();
  push(a(), 0, {on(7, 3, 1)});
  push(b(), 0, {on(0, 0, 2), on(7, 3, 3)});
  EXPECT_EQ(next_size(), "16x5");
  EXPECT_EQ(merged_, (Events{on_at(7, 3, 1), on_at(8, 1, 2), on_at(15, 4, 3)}));
  place_second(0, 0);
  push(a(), 10 * ms, {on(7, 3, 1)});
  push(b(), 10 * ms, {on(0, 0, 2)});
  EXPECT_EQ(next_size(), "8x4");
  EXPECT_EQ(merged_.back(), on_at(0, 0, 10'002));
}

/// A launch line sets the position of a pad that it releases until there is a stream to link.
TEST_F(MergeTest, KeepsThePositionOfAPadOnlyUntilItIsLinked) {
  const auto requested = [this] {
    return Owned<GstPad>(gst_element_request_pad_simple(element(), "sink_7"));
  };
  const auto xpos_of = [](const Owned<GstPad>& pad) {
    guint xpos = 0;
    g_object_get(pad.get(), "xpos", &xpos, nullptr);
    return xpos;
  };
  const auto release = [this](Owned<GstPad> pad) {
    gst_element_release_request_pad(element(), pad.get());
  };
  auto pad = requested();
  g_object_set(pad.get(), "xpos", 8, nullptr);
  release(std::move(pad));
  pad = requested();
  EXPECT_EQ(xpos_of(pad), 8U);
  const Owned<GstPad> source(gst_pad_new(nullptr, GST_PAD_SRC));
  ASSERT_EQ(gst_pad_link(source.get(), pad.get()), GST_PAD_LINK_OK);
  gst_pad_unlink(source.get(), pad.get());
  release(std::move(pad));
  pad = requested();
  EXPECT_EQ(xpos_of(pad), 0U);
  release(std::move(pad));
}

TEST_F(MergeTest, HasTheSizeThatDownstreamWants) {
  gst_harness_set_sink_caps_str(a(), "application/x-event-camera, width=20, height=30");
  begin();
  push(a(), 0, {on(7, 3, 1)});
  push(b(), 0, {});
  EXPECT_EQ(next_size(), "20x30");
}

TEST_F(MergeTest, RefusesASizeThatIsTooSmall) {
  gst_harness_set_sink_caps_str(a(), "application/x-event-camera, width=4, height=4");
  begin();
  push(a(), 0, {on(7, 3, 1)});
  push(b(), 0, {});
  EXPECT_TRUE(contains(inputs_.error(), "need 8 x 4"));
}

TEST_F(MergeTest, RefusesASensorThatIsTooLarge) {
  place_second(16'380, 0);
  begin();
  push(a(), 0, {on(7, 3, 1)});
  push(b(), 0, {});
  EXPECT_TRUE(contains(inputs_.error(), "16388 x 4 pixels"));
}

TEST_F(MergeTest, GoesOnWithoutAStreamThatEndsBeforeItBegins) {
  gst_harness_set_src_caps_str(a(), small);
  push_eos(b());
  push(a(), 0, {on(1, 0, 1)});
  EXPECT_EQ(rest(), Events{on_at(1, 0, 1)});
}

TEST_F(MergeTest, EndsASegmentOnceAllStreamsHave) {
  begin();
  push(a(), 0, {on(1, 0, 0)});
  end_segment(a());
  push(b(), 0, {on(2, 0, 1)});
  push(b(), 10 * ms, {on(3, 0, 2)});
  for (const std::size_t size : {2, 1}) {
    const Buffer buffer(gst_harness_pull(a()));
    ASSERT_TRUE(buffer);
    EXPECT_EQ(events_of(buffer.get()).size(), size);
  }
  while (const Owned<GstEvent> event{gst_harness_try_pull_event(a())})
    EXPECT_NE(GST_EVENT_TYPE(event.get()), GST_EVENT_SEGMENT_DONE);
  end_segment(b(), 20 * ms);
  const auto done = next_event(a(), GST_EVENT_SEGMENT_DONE);
  ASSERT_TRUE(done);
  gint64 position = -1;
  gst_event_parse_segment_done(done.get(), nullptr, &position);
  EXPECT_EQ(position, gint64{20 * ms});
}

/// Lets an input answer that it can seek within its first second.
void make_seekable(GstHarness* input) {
  gst_pad_set_query_function(
      input->srcpad, +[](GstPad* pad, GstObject* parent, GstQuery* query) -> gboolean {
        if (GST_QUERY_TYPE(query) != GST_QUERY_SEEKING)
          return gst_pad_query_default(pad, parent, query);
        GstFormat format = GST_FORMAT_UNDEFINED;
        gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
        gst_query_set_seeking(query, format, TRUE, 0, GST_SECOND);
        return TRUE;
      });
}

/// A seek is forwarded to all streams, or refused.
TEST_F(MergeTest, IsSeekableWhereAllStreamsAre) {
  const auto is_seekable = [this](GstFormat format) {
    GstQuery* const query = gst_query_new_seeking(format);
    gboolean seekable = FALSE;
    EXPECT_TRUE(gst_pad_peer_query(a()->sinkpad, query));
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
    gst_query_unref(query);
    return seekable != FALSE;
  };
  make_seekable(a());
  EXPECT_FALSE(is_seekable(GST_FORMAT_TIME));
  make_seekable(b());
  EXPECT_TRUE(is_seekable(GST_FORMAT_TIME));
  EXPECT_FALSE(is_seekable(GST_FORMAT_BYTES));
}

TEST_F(MergeTest, SendsGapsWhereNoStreamHasEvents) {
  begin();
  push(a(), 0, {on(1, 0, 1)});
  push_gap(b(), 0);
  push_gap(a(), 10 * ms);
  push_gap(b(), 10 * ms, 20 * ms);
  push(a(), 20 * ms, {on(2, 0, 1)});
  EXPECT_EQ(rest(), (Events{on_at(1, 0, 1), on_at(2, 0, 20'001)}));
  std::vector<Gap> gaps;
  while (const Owned<GstEvent> event{gst_harness_try_pull_event(a())})
    if (GST_EVENT_TYPE(event.get()) == GST_EVENT_GAP) gaps.push_back(gap_of(event.get()));
  EXPECT_EQ(gaps, (std::vector<Gap>{{10 * ms, 10 * ms}}));
}

TEST_F(MergeTest, BeginsWithAnEmptyIntervalIfNothingHappens) {
  begin();
  push_gap(a(), 0);
  push_gap(b(), 0);
  const Buffer buffer(gst_harness_pull(a()));
  ASSERT_TRUE(buffer);
  EXPECT_EQ(gst_buffer_get_size(buffer.get()), 0U);
  EXPECT_EQ(GST_BUFFER_DURATION(buffer.get()), 10 * ms);
}

/// Such as triggers.
TEST_F(MergeTest, PassesCustomEventsOnInTheirPlace) {
  const OutputOrder output(a());
  begin();
  push_custom(a(), "first");
  push(a(), 0, {on(1, 0, 1)});
  push(b(), 0, {on(2, 0, 1)});
  push_custom(b(), "second");
  push(a(), 10 * ms, {on(1, 0, 1)});
  push(b(), 10 * ms, {on(2, 0, 1)});
  push_custom(a(), "last");
  EXPECT_EQ(rest().size(), 4U);
  EXPECT_EQ(output.names(),
            (std::vector<std::string>{"stream-start", "caps", "segment", "first", "buffer",
                                      "second", "buffer", "last", "eos"}));
}

TEST_F(MergeTest, FollowsCapsThatChange) {
  begin();
  push(a(), 0, {on(7, 3, 1)});
  push(b(), 0, {on(7, 3, 2)});
  EXPECT_EQ(next_size(), "8x4");
  gst_harness_set_src_caps_str(b(), "application/x-event-camera, format=XYTP, width=9, height=40");
  push(a(), 10 * ms, {on(7, 3, 1)});
  push(b(), 10 * ms, {on(8, 39, 2)});
  EXPECT_EQ(next_size(), "9x40");
  EXPECT_EQ(merged_.back(), on_at(8, 39, 10'002));
  EXPECT_EQ(stat_of(element(), "rejected-events"), 0U);
}

TEST_F(MergeTest, DropsWhatHasNoTimeOrIsOutsideOrUnsorted) {
  begin();
  push(a(), GST_CLOCK_TIME_NONE, {on(1, 0, 1)});
  push(b(), 0, {on(2, 0, 2)});
  push(a(), 0, {on(8, 0, 1), on(1, 0, 3), on(1, 0, 2), on(1, 0, 10'001)});
  EXPECT_EQ(rest(), (Events{on_at(2, 0, 2), on_at(1, 0, 3)}));
  EXPECT_EQ(stat_of(element(), "rejected-events"), 3U);
  int warnings = 0;
  while (inputs_.message(GST_MESSAGE_WARNING)) ++warnings;
  EXPECT_EQ(warnings, 3);
}

TEST_F(MergeTest, DropsIntervalsThatGoBack) {
  begin();
  push(a(), 0, {on(1, 0, 1)});
  push(b(), 0, {on(2, 0, 2)});
  push(a(), 5 * ms, {on(3, 0, 4'000), on(3, 0, 6'000)});
  EXPECT_EQ(rest(), (Events{on_at(1, 0, 1), on_at(2, 0, 2), on_at(3, 0, 11'000)}));
  EXPECT_EQ(stat_of(element(), "late-events"), 1U);
}

/// One stream is in its next recording before the other one.
TEST_F(MergeTest, StartsOverOnceAllStreamsGoBackWithNewSegments) {
  std::vector<std::pair<GstClockTime, Events>> output;  // buffers by running time, ms
  watch(a()->sinkpad, {[&, pad = a()->sinkpad](GstBuffer* buffer) {
          const Owned<GstEvent> event(gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0));
          GstSegment segment;
          gst_event_copy_segment(event.get(), &segment);
          const auto time =
              gst_segment_to_running_time(&segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
          append_events(buffer, output.emplace_back(time / ms, Events()).second);
        }});
  begin();
  push(a(), 0, {on(1, 0, 1)});
  push(b(), 0, {on(2, 0, 2)});
  push_segment(b(), {.base = 100 * ms});
  push(b(), 0, {on(5, 0, 5)});
  push(a(), 10 * ms, {on(3, 0, 3)});
  push_segment(a(), {.base = 100 * ms});
  push(a(), 0, {on(4, 0, 4)});
  push_eos(a());
  push(b(), 10 * ms, {on(6, 0, 6)});
  push_segment(b(), {.base = 200 * ms});
  push(b(), 0, {on(7, 0, 7)});
  push_eos(b());
  ASSERT_TRUE(next_event(a(), GST_EVENT_EOS));
  EXPECT_EQ(output,
            (std::vector<std::pair<GstClockTime, Events>>{{0, {on_at(1, 0, 1), on_at(2, 0, 2)}},
                                                          {10, {on_at(3, 0, 10'003)}},
                                                          {100, {on_at(4, 0, 4), on_at(5, 0, 5)}},
                                                          {110, {on_at(6, 0, 10'006)}},
                                                          {200, {on_at(7, 0, 7)}}}));
  EXPECT_EQ(stat_of(element(), "late-events"), 0U);
}

/// A GAP cannot tell it.
TEST_F(MergeTest, IsDiscontinuousAfterAGapWhereAStreamIs) {
  begin();
  push(a(), 0, {on(1, 0, 1)});
  push_gap(b(), 0);
  GstBuffer* const discontinuous = buffer_of(10 * ms, {}, 10 * ms);
  GST_BUFFER_FLAG_SET(discontinuous, GST_BUFFER_FLAG_DISCONT);
  gst_harness_push(a(), discontinuous);
  push_gap(b(), 10 * ms);
  for (const GstClockTime start : {20, 30}) {
    push(a(), start * ms, {on(1, 0, 1)});
    push_gap(b(), start * ms);
  }
  for (const GstClockTime start : {0, 20, 30}) {
    const Buffer buffer(gst_harness_pull(a()));
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), start * ms);
    EXPECT_EQ(GST_BUFFER_IS_DISCONT(buffer.get()) != FALSE, start < 30) << start;
  }
}

TEST_F(MergeTest, KeepsLabels) {
  begin();
  GstBuffer* const labelled = buffer_of(0, {on(1, 0, 1), on(2, 0, 3)}, 10 * ms);
  const GstEventCameraLabel labels[] = {{7, GST_EVENT_CAMERA_CAUSE_LIGHT, 0},
                                        {0, GST_EVENT_CAMERA_CAUSE_LEAK, 0}};
  gst_buffer_add_event_camera_label_meta(labelled, labels, 2);
  gst_harness_push(a(), labelled);
  push(b(), 0, {on(3, 0, 2)});
  const Buffer buffer(gst_harness_pull(a()));
  ASSERT_TRUE(buffer);
  const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
  ASSERT_NE(meta, nullptr);
  ASSERT_EQ(meta->n_labels, 3U);
  EXPECT_EQ(meta->labels[0].object_class, 7);
  EXPECT_EQ(meta->labels[1].cause, GST_EVENT_CAMERA_CAUSE_UNKNOWN);
  EXPECT_EQ(meta->labels[2].cause, GST_EVENT_CAMERA_CAUSE_LEAK);
}

/* pipelines */

/// Recordings of one clock, the second of which starts 10 s later.
struct Distant {
  std::string line() const {
    const auto source = [](const TemporaryFile& file) {
      return file.source() + "eventcsvdec width=8 height=4 ! ";
    };
    return "eventmerge name=m  " + source(late) + "m.sink_0  " + source(early) + "m.sink_1  m.";
  }

  TemporaryFile early{std::string("t,x,y,p\n1000000,1,1,1\n1999000,2,1,1\n")};
  TemporaryFile late{std::string("t,x,y,p\n11000000,3,1,1\n11999000,4,1,1\n")};
};

TEST(Merge, LastsFromTheFirstStartToTheLastEnd) {
  const Distant recordings;
  Player player(recordings.line());
  ASSERT_TRUE(player.reaches(GST_STATE_PAUSED)) << player.error;
  const auto duration = player.duration();
  GstQuery* const seeking = gst_query_new_seeking(GST_FORMAT_TIME);
  EXPECT_TRUE(gst_element_query(player["sink"], seeking));
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_EQ(player.events.size(), 4U);
  EXPECT_EQ(duration / ms, 10'999U);
  gboolean seekable = FALSE;
  gint64 start = -1;
  gint64 end = -1;
  gst_query_parse_seeking(seeking, nullptr, &seekable, &start, &end);
  gst_query_unref(seeking);
  EXPECT_TRUE(seekable);
  EXPECT_EQ(start, 0);
  EXPECT_EQ(end, static_cast<gint64>(duration));
  EXPECT_EQ(player.position() / ms, 10'999U);
}

/// Positions count from the start of the first recording. The second seek comes before the segments
/// of the first one.
TEST(Merge, SeeksInTheStreamTimeOfItsOutput) {
  const Distant recordings;
  struct Range {
    GstClockTime start;
    GstClockTime stop;
    Events events;
  };
  const auto early = on_at(2, 1, 1'999'000);
  const auto late = on_at(3, 1, 11'000'000);
  for (const auto& [start, stop, events] :
       {Range{500 * ms, 10'500 * ms, {early, late}}, Range{500 * ms, 5'000 * ms, {early}},
        Range{5'000 * ms, 10'500 * ms, {late}}, Range{10'000 * ms, 10'500 * ms, {late}}}) {
    Player player(recordings.line());
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED)) << player.error;
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(player.seek(start, stop));
    ASSERT_TRUE(player.reaches(GST_STATE_PAUSED));
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.events, events);
    const Owned<GstEvent> event(
        gst_pad_get_sticky_event(GST_BASE_SINK_PAD(player["sink"]), GST_EVENT_SEGMENT, 0));
    ASSERT_TRUE(event);
    GstSegment segment;
    gst_event_copy_segment(event.get(), &segment);
    EXPECT_EQ(segment.time, start);
    EXPECT_EQ(segment.start, GST_SECOND + start);
    EXPECT_EQ(segment.stop, GST_SECOND + stop);
  }
}

/// Only a seek that flushes reaches streams that are read at different times.
TEST(Merge, CountsASeekFromTheEndOfTheLastRecording) {
  const Distant recordings;
  Player player(recordings.line());
  ASSERT_TRUE(player.reaches(GST_STATE_PAUSED)) << player.error;
  EXPECT_FALSE(gst_element_seek(player["m"], 1, GST_FORMAT_TIME, GST_SEEK_FLAG_NONE,
                                GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_NONE, -1));
  EXPECT_TRUE(gst_element_seek(player["m"], 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                               GST_SEEK_TYPE_END, -static_cast<gint64>(2 * GST_SECOND),
                               GST_SEEK_TYPE_NONE, -1));
  ASSERT_TRUE(player.play()) << player.error;
  EXPECT_EQ(player.events, (Events{on_at(3, 1, 11'000'000), on_at(4, 1, 11'999'000)}));
}

TEST(Merge, WaitsForTheSecondStreamWhereTheFirstIsEmpty) {
  gst_init(nullptr, nullptr);
  const Owned<GstHarness> first(gst_harness_new_empty());
  gst_harness_set_live(first.get(), FALSE);  // before the element asks
  const Owned<GstElement> element(
      GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("eventmerge", nullptr))));
  GstStaticPadTemplate src =
      GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
  GstStaticPadTemplate sink =
      GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
  gst_harness_add_element_full(first.get(), element.get(), &src, "sink_0", &sink, "src");
  gst_harness_set_src_caps_str(first.get(), small);
  push_eos(first.get());
  g_usleep(20'000);  // for the element's thread
  const Owned<GstHarness> second(gst_harness_new_with_element(element.get(), "sink_1", nullptr));
  gst_harness_set_live(second.get(), FALSE);
  gst_harness_set_src_caps_str(second.get(), small);
  EXPECT_EQ(gst_harness_push(second.get(), buffer_of(0, {on(2, 0, 0)}, 10 * ms)), GST_FLOW_OK);
  push_eos(second.get());
  EXPECT_EQ(pull_until_eos(first.get()).size(), 1U);
}

TEST(Merge, GoesOnWithALiveStreamAlone) {
  for (const int frames : {0, 15}) {
    Player player("videotestsrc is-live=true pattern=ball num-buffers=" + std::to_string(frames) +
                  " ! video/x-raw, width=64, height=48, framerate=50/1 ! eventsim-frame ! queue ! "
                  "m.sink_0  eventmerge name=m");
    ASSERT_TRUE(player.play()) << player.error;
    EXPECT_EQ(player.events.size() > 100, frames > 0);
  }
}

/// The live stream goes on without the other one, whose events are then too late.
TEST(Merge, GoesOnWithoutALateLiveStream) {
  Player player(
      "videotestsrc is-live=true pattern=ball ! video/x-raw, width=64, height=48, "
      "framerate=10/1 ! eventsim-frame ! queue ! m.sink_0  appsrc name=late is-live=true "
      "format=time "
      "caps=\"application/x-event-camera, format=XYTP, width=8, height=4\" ! queue ! m.sink_1  "
      "eventmerge "
      "name=m");
  player.set(GST_STATE_PLAYING);
  const auto wait_until = [&](const auto& done) {
    for (int i = 0; i < 1000 && !done(); ++i) g_usleep(10'000);
    return done();
  };
  ASSERT_TRUE(wait_until([&] { return player.stat("m", "events") > 100; }));
  gst_app_src_push_buffer(GST_APP_SRC(player["late"]), buffer_of(0, {on(1, 1, 1)}, 10 * ms));
  EXPECT_TRUE(wait_until([&] { return player.stat("m", "late-events") == 1; }));
  const auto before = player.stat("m", "events");
  EXPECT_TRUE(wait_until([&] { return player.stat("m", "events") > before; }));
}

}  // namespace
