// SPDX-License-Identifier: LGPL-2.1-or-later
// Labels of events: eventlabel, and those of eventsim-dvs on their way to measures and files.
#include <array>
#include <span>
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

/* labels of simulated events */

const std::string noisy =
    "eventsim-dvs preset=davis346 shot-noise-rate=20 leak-rate=5 hot-pixels=0.01 "
    "exposure-pulse=0.05 exposure-lead=9000000 seed=3 ";

/// Frames of a ball that moves over noise-free grey.
std::vector<Buffer> simulated(const std::string& launch,
                              const std::string& out_caps = GST_EVENT_CAMERA_MEDIA_TYPE) {
  Harness h(launch);
  h.caps("video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1", out_caps);
  std::vector<Buffer> buffers;
  for (int i = 0; i < 8; ++i) {
    h.push(h.frame(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, [i](int x, int y) {
      return (x - 6 * i) * (x - 6 * i) + (y - 20) * (y - 20) < 100 ? 220 : 60;
    }));
    while (auto buffer = h.pull()) buffers.push_back(std::move(buffer));
  }
  return buffers;
}

using Counts = std::array<guint64, 6>;

Counts counts_of(const std::vector<Buffer>& buffers) {
  Counts counts{};
  for (const auto& buffer : buffers) {
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    if (meta == nullptr) continue;
    for (gsize i = 0; i < meta->n_labels; ++i) ++counts.at(meta->labels[i].cause);
  }
  return counts;
}

constexpr std::array names = {"unknown-events",    "light-events",     "leak-events",
                              "shot-noise-events", "hot-pixel-events", "exposure-pulse-events"};

TEST(Labels, AreMadeOnRequestAndChangeNoEvent) {
  const auto plain = simulated(noisy);
  const auto labelled = simulated(noisy + "label=true");
  ASSERT_EQ(plain.size(), 7U);
  ASSERT_EQ(labelled.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(bytes_of(labelled[i].get()), bytes_of(plain[i].get()));
    EXPECT_EQ(gst_buffer_get_event_camera_label_meta(plain[i].get()), nullptr);
    EXPECT_NE(gst_buffer_get_event_camera_label_meta(labelled[i].get()), nullptr);
  }
  const auto counts = counts_of(labelled);
  EXPECT_EQ(counts[0], 0U);
  for (const auto count : std::span(counts).subspan(1)) EXPECT_GT(count, 0U);
}

TEST(Labels, AreNotMadeForDrawnEvents) {
  const auto pictures = simulated(noisy, "video/x-raw, format=RGBA");
  const auto of_labelled = simulated(noisy + "label=true", "video/x-raw, format=RGBA");
  ASSERT_EQ(pictures.size(), 8U);
  ASSERT_EQ(of_labelled.size(), pictures.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    EXPECT_EQ(bytes_of(of_labelled[i].get()), bytes_of(pictures[i].get()));
    EXPECT_EQ(gst_buffer_get_meta(of_labelled[i].get(), GST_EVENT_CAMERA_LABEL_META_API_TYPE),
              nullptr);
  }
}

TEST(Labels, AreCountedByEventstats) {
  for (const bool is_labelled : {true, false}) {
    const auto buffers = simulated(noisy + (is_labelled ? "label=true" : ""));
    const auto expected = counts_of(buffers);
    Harness h("eventstats interval=0");
    h.caps("application/x-event-camera, format=XYTP, width=64, height=48");
    for (const auto& buffer : buffers) h.push(gst_buffer_ref(buffer.get()));
    push_eos(h.get());
    const auto message = h.message(GST_MESSAGE_ELEMENT);
    ASSERT_TRUE(message);
    const auto* figures = gst_message_get_structure(message.get());
    for (std::size_t i = 0; i < names.size(); ++i) {
      guint64 count = 0;
      EXPECT_EQ(gst_structure_get_uint64(figures, names[i], &count) != FALSE, is_labelled);
      EXPECT_EQ(count, expected.at(i)) << names[i];
    }
  }
}

void write(const std::vector<Buffer>& buffers, const std::string& writer) {
  Pipeline pipeline(
      "appsrc name=in format=time caps=\"application/x-event-camera, format=XYTP, width=64, "
      "height=48, framerate=0/1\" ! " +
      writer);
  GstFlowReturn flow = GST_FLOW_ERROR;
  for (const auto& buffer : buffers)
    g_signal_emit_by_name(pipeline["in"], "push-buffer", buffer.get(), &flow);
  g_signal_emit_by_name(pipeline["in"], "end-of-stream", &flow);
  ASSERT_TRUE(pipeline.play()) << pipeline.error;
}

TEST(Labels, AreReadBack) {
  const auto buffers = simulated(noisy + "label=true");
  guint16 object_class = 0;
  for (const auto& buffer : buffers) {
    auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    for (gsize i = 0; i < meta->n_labels; ++i) meta->labels[i].object_class = object_class += 31;
  }
  const TemporaryFile text;
  write(buffers, "eventcsvenc format=labels" + text.sink());
  const auto expected = text.bytes();
  ASSERT_GT(expected.size(), 10'000U);

  for (const auto& [encoder, decoder] : {std::pair("eventcsvenc format=labels", "eventcsvdec"),
                                         {"eventnpzenc", "eventnpzdec"},
                                         {"eventhdf5sink format=dsec", "eventhdf5dec"}}) {
    const TemporaryFile file;
    const bool is_sink = std::string(encoder).starts_with("eventhdf5sink");
    write(buffers, encoder + (is_sink ? " location=" + in_quotes(file.path()) : file.sink()));
    EXPECT_TRUE(copied(file, std::string(decoder) + " ! eventcsvenc format=labels") == expected)
        << decoder;
  }
}

}  // namespace
