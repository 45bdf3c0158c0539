// SPDX-License-Identifier: LGPL-2.1-or-later
// eventoverlay and eventfuse: which events change which frame, and when.
#include "src/core/event.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;

class OverlayTest : public testing::Test {
 protected:
  explicit OverlayTest(const std::string& launch = "eventoverlay palette=grey")
      : overlay(launch, "video_sink", "event_sink") {
    gst_harness_set_sink_caps_str(video.get(), "video/x-raw, format=GRAY8");
  }

  void begin(const std::string& sensor_size, const std::string& format = "GRAY8",
             const std::string& framerate = "25/1", const std::string& shown = {}) {
    gst_harness_set_sink_caps_str(
        video.get(), ("video/x-raw, format=" + (shown.empty() ? format : shown)).c_str());
    gst_harness_set_src_caps_str(
        video.get(),
        ("video/x-raw, format=" + format + ", width=8, height=4, framerate=" + framerate).c_str());
    gst_harness_set_src_caps_str(
        events.get(), ("application/x-event-camera, format=XYTP, " + sensor_size).c_str());
  }

  void push_frame(GstClockTime pts, GstClockTime duration = 40 * ms) {
    gst_harness_push(video.get(), filled(32, 100, pts, duration));
  }

  void push_events(GstClockTime pts, const std::vector<Event>& list,
                   GstClockTime duration = 40 * ms) {
    gst_harness_push(events.get(), buffer_of(pts, list, duration));
  }

  /// Pixels of the next frame that differ from grey 100, and their values.
  std::vector<std::pair<int, int>> drawn() {
    const Buffer frame(gst_harness_pull(video.get()));
    if (!frame) return {{-1, -1}};
    last_pts = GST_BUFFER_PTS(frame.get());
    const auto bytes = bytes_of(frame.get());
    std::vector<std::pair<int, int>> places;
    for (int i = 0; i < 32; ++i)
      if (bytes[static_cast<std::size_t>(i)] != 100)
        places.emplace_back(i, static_cast<guint8>(bytes[static_cast<std::size_t>(i)]));
    return places;
  }

  TwoInputs overlay;
  Owned<GstHarness>& video = overlay.first;
  Owned<GstHarness>& events = overlay.second;
  GstClockTime last_pts = 0;
};

using Places = std::vector<std::pair<int, int>>;

TEST_F(OverlayTest, CutsBuffersOfEventsWhereFramesEnd) {
  begin("width=8, height=4");
  push_frame(0);
  push_events(0, {on(0, 0, 40'000), on(1, 0, 40'001), on(2, 0, 80'001)}, 120 * ms);
  EXPECT_EQ(drawn(), (Places{{0, 255}}));
  push_frame(40 * ms);
  EXPECT_EQ(drawn(), (Places{{1, 255}}));
  push_frame(80 * ms);
  EXPECT_EQ(drawn(), (Places{{2, 255}}));
}

TEST_F(OverlayTest, DrawsTheEventsSinceTheLastFrameWhereItsEndIsNotKnown) {
  begin("width=8, height=4", "GRAY8", "0/1");
  push_frame(0, GST_CLOCK_TIME_NONE);
  push_events(0, {on(0, 0, 0), on(1, 0, 40'000), on(2, 0, 40'001), on(3, 0, 90'000)}, 120 * ms);
  EXPECT_EQ(drawn(), Places{});
  push_frame(40 * ms, GST_CLOCK_TIME_NONE);
  EXPECT_EQ(drawn(), (Places{{0, 255}, {1, 255}}));
  push_frame(90 * ms, GST_CLOCK_TIME_NONE);
  EXPECT_EQ(drawn(), (Places{{2, 255}, {3, 255}}));
}

TEST_F(OverlayTest, DrawsTheEventsOfEachFrameAtEveryRate) {
  begin("width=8, height=4");
  for (const double rate : {0.5, 1., 2.}) {
    overlay.start_over({.rate = rate});
    for (int i = 0; i < 2; ++i) {
      const auto start = static_cast<GstClockTime>(i) * 40 * ms;
      push_frame(start);
      for (int half = 0; half < 2; ++half)
        push_events(start + static_cast<GstClockTime>(half) * 20 * ms,
                    {on(i, 2 * half, 5'000), on(i, 2 * half + 1, 15'000)}, 20 * ms);
      EXPECT_EQ(drawn(), (Places{{i, 255}, {8 + i, 255}, {16 + i, 255}, {24 + i, 255}})) << rate;
    }
  }
}

TEST_F(OverlayTest, LetsTheVideoUseTheMemoryOfDownstream) {
  gst_pad_add_probe(
      video->sinkpad, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo* info, gpointer) {
        auto* const query = GST_PAD_PROBE_INFO_QUERY(info);
        if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION) return GST_PAD_PROBE_OK;
        gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
        return GST_PAD_PROBE_HANDLED;
      },
      nullptr, nullptr);
  begin("width=8, height=4");
  const Owned<GstCaps> caps(gst_pad_get_current_caps(video->srcpad));
  GstQuery* const query = gst_query_new_allocation(caps.get(), TRUE);
  EXPECT_TRUE(gst_pad_peer_query(video->srcpad, query));
  EXPECT_TRUE(gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr));
  gst_query_unref(query);
}

TEST_F(OverlayTest, LetsDownstreamChangeTheFormatOfTheVideo) {
  begin("width=8, height=4");
  push_frame(0);
  push_events(0, {});
  EXPECT_EQ(drawn(), Places{});
  while (const Owned<GstEvent> event{gst_harness_try_pull_upstream_event(video.get())}) continue;
  gst_harness_push_upstream_event(video.get(), gst_event_new_reconfigure());
  bool is_passed = false;
  while (const Owned<GstEvent> event{gst_harness_try_pull_upstream_event(video.get())})
    is_passed = is_passed || GST_EVENT_TYPE(event.get()) == GST_EVENT_RECONFIGURE;
  EXPECT_TRUE(is_passed);
}

TEST_F(OverlayTest, DrawsInColourOverGreyVideo) {
  g_object_set(overlay.element.get(), "palette", 3, nullptr);  // red-blue
  begin("width=8, height=4", "GRAY8", "25/1", "{ RGB, GRAY8 }");
  push_frame(0);
  push_events(0, {off(1, 0, 5)});
  const Buffer frame(gst_harness_pull(video.get()));
  ASSERT_TRUE(frame);
  EXPECT_EQ(GST_BUFFER_PTS(frame.get()), 0U);
  EXPECT_EQ(GST_BUFFER_DURATION(frame.get()), 40 * ms);
  const auto bytes = bytes_of(frame.get());
  ASSERT_EQ(bytes.size(), 96U);
  EXPECT_EQ(bytes.substr(0, 3), "ddd");                                     // grey 100
  EXPECT_GT(static_cast<guint8>(bytes[3]), static_cast<guint8>(bytes[5]));  // red
}

TEST_F(OverlayTest, ScalesTheSensorToTheVideo) {
  begin("width=4, height=4");
  push_frame(0);
  push_events(0, {on(1, 2, 5)});
  EXPECT_EQ(drawn(), (Places{{18, 255}, {19, 255}}));
  gst_harness_set_src_caps_str(events.get(),
                               "application/x-event-camera, format=XYTP, width=16, height=8");
  push_frame(40 * ms);
  push_events(40 * ms, {on(14, 7, 5), off(15, 6, 5)});
  EXPECT_EQ(drawn(), (Places{{31, 64}}));
}

TEST_F(OverlayTest, GoesOnThroughGapsAndPastTheEndOfEvents) {
  begin("width=8, height=4");
  push_frame(0);
  push_gap(events.get(), 0, 40 * ms);
  EXPECT_EQ(drawn(), Places{});
  push_frame(40 * ms);
  push_eos(events.get());
  EXPECT_EQ(drawn(), Places{});
  push_frame(80 * ms);
  EXPECT_EQ(drawn(), Places{});
  push_eos(video.get());
  EXPECT_TRUE(pull_until_eos(video.get()).empty());
}

TEST_F(OverlayTest, PassesGapsInTheVideoOn) {
  begin("width=8, height=4");
  push_gap(video.get(), 0, 40 * ms);  // before any frame
  push_events(0, {});
  push_frame(40 * ms);
  push_events(40 * ms, {});
  EXPECT_EQ(drawn(), Places{});
  push_gap(video.get(), 80 * ms, 40 * ms);
  push_events(80 * ms, {on(1, 0, 5)});
  push_frame(120 * ms);
  push_events(120 * ms, {});
  EXPECT_EQ(drawn(), Places{});
  EXPECT_EQ(last_pts, 120 * ms);
  GstClockTime start = GST_CLOCK_TIME_NONE;
  while (const Owned<GstEvent> event{gst_harness_try_pull_event(video.get())})
    if (GST_EVENT_TYPE(event.get()) == GST_EVENT_GAP) start = gap_of(event.get()).start;
  EXPECT_EQ(start, 80 * ms);
}

class OverlayHalf : public OverlayTest {
 protected:
  OverlayHalf() : OverlayTest("eventoverlay palette=grey opacity=0.5 accumulation-time=80000000") {}
};

TEST_F(OverlayHalf, MixesAndRemembers) {
  begin("width=8, height=4");
  push_frame(0);
  push_events(0, {off(1, 0, 5)});
  EXPECT_EQ(drawn(), (Places{{1, 50}}));
  push_frame(40 * ms);
  push_events(40 * ms, {off(2, 0, 5)});
  EXPECT_EQ(drawn(), (Places{{1, 50}, {2, 50}}));
  push_frame(80 * ms);
  push_gap(events.get(), 80 * ms, 40 * ms);
  EXPECT_EQ(drawn(), (Places{{2, 50}}));
}

TEST_F(OverlayTest, DrawsAllEventsAfterAFlushOfTheseAlone) {
  begin("width=8, height=4");
  push_frame(0);
  push_events(0, {on(1, 0, 5), on(2, 0, 50'000)}, 100 * ms);
  EXPECT_EQ(drawn(), (Places{{1, 255}}));
  flush({events.get()});
  push_segment(events.get());
  push_frame(40 * ms);
  push_events(40 * ms, {on(3, 0, 5)});
  EXPECT_EQ(drawn(), (Places{{3, 255}}));
}

/* eventfuse */

struct Picture {
  GstClockTime time;  ///< ms
  int first;          ///< grey level of the first pixel
  int last;

  friend bool operator==(const Picture&, const Picture&) = default;
  friend void PrintTo(const Picture& picture, std::ostream* out) {
    *out << picture.time << " ms: " << picture.first << ' ' << picture.last;
  }
};

class Fusion : public TwoInputs {
 public:
  Fusion(const std::string& framerate, const std::string& output)
      : TwoInputs("eventfuse cutoff=0 positive-threshold=0.2 negative-threshold=0.3", "video_sink",
                  "event_sink") {
    begin(framerate, output);
  }

  void begin(const std::string& framerate, const std::string& output, int width = 8,
             int height = 4) {
    const auto size = ", width=" + std::to_string(width) + ", height=" + std::to_string(height);
    gst_harness_set_sink_caps_str(video.get(), ("video/x-raw, " + output).c_str());
    gst_harness_set_src_caps_str(
        video.get(), ("video/x-raw, format=GRAY8, framerate=" + framerate + size).c_str());
    gst_harness_set_src_caps_str(events.get(),
                                 ("application/x-event-camera, format=XYTP" + size).c_str());
  }

  void push_frame(GstClockTime pts, int grey, GstClockTime duration = 40 * ms) {
    gst_harness_push(video.get(), filled(32, grey, pts, duration));
  }

  void push_events(GstClockTime pts, const std::vector<Event>& list, GstClockTime duration) {
    gst_harness_push(events.get(), buffer_of(pts, list, duration));
  }

  std::vector<Picture> pictures() {
    std::vector<Picture> all;
    for (const auto& picture : pull_until_eos(video.get())) {
      const auto bytes = bytes_of(picture.get());
      all.push_back({GST_BUFFER_PTS(picture.get()) / ms, static_cast<guint8>(bytes.front()),
                     static_cast<guint8>(bytes.back())});
    }
    return all;
  }

  Owned<GstHarness>& video = first;
  Owned<GstHarness>& events = second;
};

TEST(Fuse, PlacesAFrameWithoutTimeAfterTheLastOne) {
  Fusion fuse("25/1", "framerate=50/1");
  fuse.push_frame(0, 100);
  fuse.push_events(0, {on(0, 0, 90'000)}, 100 * ms);
  fuse.push_frame(GST_CLOCK_TIME_NONE, 200);
  fuse.end();
  EXPECT_EQ(fuse.pictures(),
            (std::vector<Picture>{{0, 100, 100}, {20, 100, 100}, {40, 100, 100}, {60, 100, 100}}));
}

TEST(Fuse, ShowsTheEventsUpToEachPicture) {
  struct Case {
    std::string framerate;  // of the video
    GstClockTime duration;
    std::string output;
    std::vector<Picture> pictures;
  };
  // 125 + o = (100 + o) e^0.2, 71 + o = (100 + o) e^-0.3, o = 12.75
  const Case cases[] = {
      {"25/1",
       40 * ms,
       "framerate=50/1",
       {{0, 100, 100}, {20, 125, 100}, {40, 125, 71}, {60, 155, 71}}},
      {"25/1",
       GST_CLOCK_TIME_NONE,
       "framerate=50/1",
       {{0, 100, 100}, {20, 125, 100}, {40, 125, 71}, {60, 155, 71}}},
      {"25/1", 40 * ms, "format=GRAY8", {{0, 100, 100}, {40, 125, 71}}},
      {"0/1", 40 * ms, "format=GRAY8", {{0, 100, 100}, {40, 125, 71}}},
      {"0/1",
       GST_CLOCK_TIME_NONE,
       "framerate=50/1",
       {{0, 100, 100}, {20, 125, 100}, {40, 125, 71}}},
  };
  for (const Case& test : cases) {
    Fusion fuse(test.framerate, test.output);
    fuse.push_frame(0, 100, test.duration);
    fuse.push_events(0, {on(0, 0, 20'000), off(7, 3, 20'001)}, 50 * ms);
    fuse.push_frame(40 * ms, 200, test.duration);
    fuse.push_events(50 * ms, {on(0, 0, 0)}, 30 * ms);
    fuse.end();
    EXPECT_EQ(fuse.pictures(), test.pictures) << test.framerate << ' ' << test.output;
  }
}

/// Also where playback is faster: the cutoff is of the scene's time.
TEST(Fuse, ApproachesTheLastFrame) {
  Fusion fuse("10/1", "framerate=10/1");
  g_object_set(fuse.element.get(), "cutoff", 1., nullptr);
  for (const double rate : {1., 2.}) {
    fuse.start_over({.rate = rate});
    fuse.push_frame(0, 100, 100 * ms);
    fuse.push_events(0, {on(0, 0, 0)}, 100 * ms);
    fuse.push_frame(100 * ms, 100, 100 * ms);
    fuse.push_events(100 * ms, {}, 100 * ms);
    for (const int grey : {100, 113}) {  // (100 + o) exp(0.2 e^(-0.2 pi)) - o
      const Buffer picture(gst_harness_pull(fuse.video.get()));
      ASSERT_TRUE(picture);
      EXPECT_EQ(static_cast<guint8>(bytes_of(picture.get()).front()), grey) << rate;
    }
  }
}

TEST(Fuse, GoesOnWhereSizesChange) {
  Fusion fuse("25/1", "framerate=50/1");
  fuse.push_frame(0, 100);
  fuse.push_events(0, {on(0, 0, 0)}, 40 * ms);
  fuse.begin("25/1", "framerate=50/1", 4, 8);
  fuse.push_events(40 * ms, {on(3, 7, 5'000)}, 40 * ms);
  fuse.push_frame(40 * ms, 50);
  fuse.end();
  EXPECT_EQ(fuse.pictures(),
            (std::vector<Picture>{{0, 100, 100}, {20, 125, 100}, {40, 50, 50}, {60, 50, 64}}));
  EXPECT_EQ(fuse.warning(), "");
}

TEST(Fuse, WarnsOfAnotherSensorSize) {
  Fusion fuse("25/1", "framerate=50/1");
  gst_harness_set_src_caps_str(fuse.events.get(),
                               "application/x-event-camera, format=XYTP, width=9, height=4");
  fuse.push_frame(0, 100);
  fuse.push_events(0, {on(0, 0, 0)}, 40 * ms);
  fuse.end();
  EXPECT_EQ(fuse.pictures(), (std::vector<Picture>{{0, 100, 100}, {20, 100, 100}}));
  EXPECT_TRUE(contains(fuse.warning(), "Insert eventscale"));
}

/// No picture of the pause.
TEST(Fuse, StartsOverAfterALeap) {
  Fusion fuse("25/1", "framerate=25/1");
  push_eos(fuse.events.get());
  fuse.push_frame(0, 100);
  fuse.push_frame(3600 * GST_SECOND, 50);
  push_eos(fuse.video.get());
  EXPECT_EQ(fuse.pictures(), (std::vector<Picture>{{0, 100, 100}, {3'600'000, 50, 50}}));
}

TEST(LiveFuse, GoesOnWithoutEvents) {
  Pipeline pipeline(
      "videotestsrc is-live=true num-buffers=10 ! video/x-raw,format=GRAY8,framerate=50/1 ! "
      "eventfuse ! video/x-raw,framerate=100/1 ! fakesink name=sink sync=true");
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  EXPECT_GE(pipeline.stat("sink", "rendered"), 19U);
}

}  // namespace
