// SPDX-License-Identifier: LGPL-2.1-or-later
// eventfuse: the brightness of its pictures, and their times.
#include "src/core/event.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;

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
