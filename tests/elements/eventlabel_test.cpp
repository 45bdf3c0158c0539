// SPDX-License-Identifier: LGPL-2.1-or-later
// eventlabel: which event has which class, and what it waits for.
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;
constexpr int width = 8;
constexpr int height = 4;

class EventLabel : public testing::Test {
 protected:
  void begin(const std::string& format = "GRAY8", const std::string& image_size = "8, height=4",
             const std::string& sensor_size = "8, height=4") {
    gst_harness_set_src_caps_str(
        events.get(),
        ("application/x-event-camera, format=XYTP, framerate=25/1, width=" + sensor_size).c_str());
    gst_harness_set_src_caps_str(
        images.get(),
        ("video/x-raw, framerate=25/1, format=" + format + ", width=" + image_size).c_str());
  }

  /// An event of each of these microseconds after `pts`, of pixels 0, 1, 2 ...
  GstFlowReturn push_events(GstClockTime pts, const std::vector<guint32>& times,
                            GstClockTime duration = 40 * ms) {
    std::vector<Event> list;
    for (const auto t : times) {
      const auto pixel = static_cast<int>(list.size());
      list.push_back(on(pixel % width, pixel / width, t));
    }
    return gst_harness_push(events.get(), buffer_of(pts, list, duration));
  }

  /// An image whose classes are `first`, `first` + 1 ...
  template <class Pixel = guint8>
  GstFlowReturn push_image(GstClockTime pts, int first, int pixels = width * height) {
    std::vector<Pixel> classes;
    for (int i = 0; i < pixels; ++i) classes.push_back(static_cast<Pixel>(first + i));
    GstBuffer* buffer = gst_buffer_new_memdup(classes.data(), classes.size() * sizeof(Pixel));
    GST_BUFFER_PTS(buffer) = pts;
    return gst_harness_push(images.get(), buffer);
  }

  /// Classes of the next buffer, less the number of the event; -1 for the class 0.
  std::vector<int> classes() {
    const Buffer buffer(gst_harness_pull(events.get()));
    if (!buffer) return {};
    last_pts = GST_BUFFER_PTS(buffer.get());
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    EXPECT_NE(meta, nullptr);
    std::vector<int> found;
    for (gsize i = 0; meta != nullptr && i < meta->n_labels; ++i) {
      const int object_class = meta->labels[i].object_class;
      found.push_back(object_class == 0 ? -1 : object_class - static_cast<int>(i));
    }
    return found;
  }

  TwoInputs label{"eventlabel", "event_sink", "video_sink"};
  Owned<GstHarness>& events = label.first;
  Owned<GstHarness>& images = label.second;
  GstClockTime last_pts = 0;
};

using Classes = std::vector<int>;

TEST_F(EventLabel, GivesEventsTheClassOfTheirPixelInTheLastImage) {
  begin();
  push_image(0, 10);
  push_events(0, {0, 39'999, 40'000});
  push_image(40 * ms, 20);
  EXPECT_EQ(classes(), (Classes{10, 10, 20}));
  push_events(40 * ms, {0, 20'000});
  push_image(80 * ms, 30);
  EXPECT_EQ(classes(), (Classes{20, 20}));
  EXPECT_EQ(last_pts, 40 * ms);
}

TEST_F(EventLabel, ReadsSeveralImagesOf16BitsPerInterval) {
  begin("GRAY16_LE");
  push_events(0, {0, 4'999, 5'000, 10'000, 19'999, 20'000, 40'000});
  push_image<guint16>(5 * ms, 1000);
  push_image<guint16>(10 * ms, 60'000);
  push_image<guint16>(20 * ms, 300);
  push_image<guint16>(90 * ms, 1);
  EXPECT_EQ(classes(), (Classes{-1, -1, 1000, 60'000, 60'000, 300, 300}));
}

TEST_F(EventLabel, RoundsTheTimesOfImagesDown) {
  begin();
  push_image(0, 10);
  push_events(500, {0, 4, 5, 6}, 10 * GST_USECOND);
  push_image(5 * GST_USECOND + 499, 20);
  push_image(40 * ms, 30);
  EXPECT_EQ(classes(), (Classes{10, 10, 20, 20}));
}

TEST_F(EventLabel, UsesTheLastImageAfterTheEnd) {
  begin();
  push_events(0, {19'999, 20'000});
  push_image(20 * ms, 7);
  push_eos(images.get());
  EXPECT_EQ(classes(), (Classes{-1, 7}));
  push_events(40 * ms, {0});
  EXPECT_EQ(classes(), Classes{7});
  push_eos(events.get());
  EXPECT_TRUE(pull_until_eos(events.get()).empty());
}

TEST_F(EventLabel, GoesOnThroughGaps) {
  begin();
  push_image(0, 3);
  push_events(0, {0});
  push_gap(images.get(), 40 * ms, 80 * ms);
  EXPECT_EQ(classes(), Classes{3});
  push_events(40 * ms, {5});
  EXPECT_EQ(classes(), Classes{3});
  push_gap(events.get(), 80 * ms, 40 * ms);
  push_image(120 * ms, 9);
  push_events(120 * ms, {5});
  push_image(160 * ms, 11);
  EXPECT_EQ(classes(), Classes{9});
  const auto gap = next_event(events.get(), GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap_of(gap.get()), (Gap{80 * ms, 40 * ms}));
}

TEST_F(EventLabel, MatchesByRunningTime) {
  begin();
  push_segment(images.get(), {.start = 1000 * ms});
  push_image(990 * ms, 3);  // before the segment, but in force when it starts
  push_events(0, {0, 20'000});
  push_image(1020 * ms, 8);
  push_image(1050 * ms, 9);
  EXPECT_EQ(classes(), (Classes{3, 8}));
}

TEST_F(EventLabel, MatchesAtEveryRate) {
  begin();
  for (const double rate : {0.5, 2.}) {
    label.start_over({.rate = rate});
    push_image(0, 3);
    push_events(0, {0, 19'999, 20'000, 40'000});
    push_image(20 * ms, 8);
    push_image(40 * ms, 9);
    EXPECT_EQ(classes(), (Classes{3, 3, 8, 9})) << rate;
  }
}

TEST_F(EventLabel, KeepsCausesAndCompletesLabels) {
  begin();
  const auto push_labelled = [&](const std::vector<GstEventCameraLabel>& labels) {
    GstBuffer* buffer = buffer_of(0, {{0, 0, 0}, {30'000, 1, 0}}, 40 * ms);
    gst_buffer_add_event_camera_label_meta(buffer, labels.data(), labels.size());
    gst_harness_push(events.get(), buffer);
  };
  const auto expect = [&](const std::vector<GstEventCameraLabel>& expected) {
    const Buffer out(gst_harness_pull(events.get()));
    const auto* meta = gst_buffer_get_event_camera_label_meta(out.get());
    ASSERT_NE(meta, nullptr);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(meta->labels[i].object_class, expected[i].object_class);
      EXPECT_EQ(meta->labels[i].cause, expected[i].cause);
    }
  };
  constexpr guint8 leak = GST_EVENT_CAMERA_CAUSE_LEAK;
  constexpr guint8 light = GST_EVENT_CAMERA_CAUSE_LIGHT;
  push_labelled({{5, leak, 0}, {6, light, 0}});
  push_image(20 * ms, 50);
  push_eos(images.get());
  expect({{5, leak, 0}, {51, light, 0}});
  push_labelled({{5, leak, 0}});  // not one per event: not valid
  expect({{50, GST_EVENT_CAMERA_CAUSE_UNKNOWN, 0}, {51, GST_EVENT_CAMERA_CAUSE_UNKNOWN, 0}});
}

TEST_F(EventLabel, NeedsImagesOfTheSizeOfTheSensor) {
  begin("GRAY8", "4, height=8");
  push_image(0, 1);
  push_events(0, {0});
  push_eos(images.get());
  EXPECT_TRUE(contains(label.error(), "Scale the images with videoscale method=nearest"));
}

TEST_F(EventLabel, FollowsChangesOfTheSize) {
  begin();
  push_image(0, 1);
  push_events(0, {0}, 20 * ms);
  push_image(20 * ms, 2);
  EXPECT_EQ(classes(), Classes{1});
  push_events(20 * ms, {1}, 19 * ms);
  begin("GRAY8", "16, height=2", "16, height=2");
  push_image(40 * ms, 3);
  EXPECT_EQ(classes(), Classes{2});
  gst_harness_push(events.get(), buffer_of(40 * ms, {on(15, 1, 0)}, 20 * ms));
  push_image(80 * ms, 4);
  EXPECT_EQ(classes(), Classes{3 + 31});
}

TEST_F(EventLabel, SkipsImagesWithoutATime) {
  begin();
  push_image(10 * ms, 1);
  push_events(0, {9'999, 10'000});
  push_image(GST_CLOCK_TIME_NONE, 2);
  push_image(5 * ms, 3);
  push_eos(images.get());
  EXPECT_EQ(classes(), (Classes{-1, 1}));
  EXPECT_TRUE(contains(label.warning(), "one has no PTS"));
  EXPECT_EQ(label.warning(), "");
}

/// A live source of events, and images that never come.
TEST(LiveEventLabel, WaitsNoLongerThanTheLatency) {
  Pipeline pipeline(
      "videotestsrc is-live=true pattern=ball num-buffers=10 ! "
      "video/x-raw,width=64,height=48,framerate=50/1 ! eventsim-diff ! eventlabel name=label ! "
      "fakesink name=sink sync=true  appsrc is-live=true format=time caps=\"video/x-raw, "
      "format=GRAY8, width=64, height=48, framerate=50/1\" ! queue ! label.video_sink");
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  EXPECT_EQ(pipeline.stat("sink", "rendered"), 9U);
}

}  // namespace
