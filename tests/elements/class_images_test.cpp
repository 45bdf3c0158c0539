// SPDX-License-Identifier: LGPL-2.1-or-later
// eventsim-dvs with class images on its pad label_sink: which event has which class, what is waited
// for, and classes on their way through other elements.
#include <atomic>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/elements/pipeline.hpp"
#include "tests/elements/recording_files.hpp"

namespace {

using namespace harness;

constexpr GstClockTime ms = GST_MSECOND;
constexpr gsize width = 32;
constexpr gsize height = 16;

class ClassImages : public testing::Test {
 protected:
  void begin(const std::string& format = "GRAY8", const std::string& image_size = "32, height=16") {
    const auto caps = [](const std::string& of_format, const std::string& size) {
      return "video/x-raw, framerate=25/1, format=" + of_format + ", width=" + size;
    };
    gst_harness_set_sink_caps_str(video.get(), GST_EVENT_CAMERA_MEDIA_TYPE);
    gst_harness_set_src_caps_str(video.get(), caps("GRAY8", "32, height=16").c_str());
    gst_harness_set_src_caps_str(images.get(), caps(format, image_size).c_str());
  }

  /// Frames alternate between black and white, so that every pixel fires in every interval.
  GstFlowReturn push_frame(GstClockTime pts) {
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, width * height, nullptr);
    gst_buffer_memset(buffer, 0, is_white_ ? 255 : 0, width * height);
    is_white_ = !is_white_;
    GST_BUFFER_PTS(buffer) = pts;
    return gst_harness_push(video.get(), buffer);
  }

  /// An image whose class is `first` plus the column.
  template <class Pixel = guint8>
  GstFlowReturn push_image(GstClockTime pts, int first) {
    std::vector<Pixel> pixels(width * height);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = static_cast<Pixel>(first + static_cast<int>(i % width));
    const gsize size = pixels.size() * sizeof(Pixel);
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
    gst_buffer_fill(buffer, 0, pixels.data(), size);
    GST_BUFFER_PTS(buffer) = pts;
    return gst_harness_push(images.get(), buffer);
  }

  struct Event {
    GstClockTime microsecond;
    int first;  ///< class, less the column
  };

  /// The events of the next interval.
  std::vector<Event> events() {
    std::vector<Event> found;
    const Buffer buffer(gst_harness_try_pull(video.get()));
    if (!buffer) return found;
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    if (meta == nullptr) return found;
    const auto all = events_of(buffer.get());
    for (std::size_t i = 0; i < all.size(); ++i) {
      EXPECT_EQ(meta->labels[i].cause, GST_EVENT_CAMERA_CAUSE_LIGHT);
      const int object_class = meta->labels[i].object_class;
      found.push_back({GST_BUFFER_PTS(buffer.get()) / 1000 + all[i].t,
                       object_class == 0 ? -1 : object_class - all[i].x});
    }
    return found;
  }

  /// Checks that the events before a time have a class, and the others another one.
  static void expect_change(const std::vector<Event>& events, GstClockTime microsecond, int before,
                            int after) {
    EXPECT_FALSE(events.empty());
    int counts[2] = {};
    for (const auto& event : events) {
      const bool is_after = event.microsecond >= microsecond;
      ++counts[is_after ? 1 : 0];
      EXPECT_EQ(event.first, is_after ? after : before) << event.microsecond;
    }
    EXPECT_GT(counts[0], 0);
    EXPECT_GT(counts[1], 0);
  }

  std::string text_of_next(GstMessageType type) {
    const auto message = dvs.message(type);
    return message ? text_of(message.get()) : "";
  }

  TwoInputs dvs{"eventsim-dvs", "sink", "label_sink"};
  Owned<GstHarness>& video = dvs.first;
  Owned<GstHarness>& images = dvs.second;

 private:
  bool is_white_ = false;
};

TEST_F(ClassImages, GiveEachEventTheClassOfItsPixelAtItsTime) {
  begin();
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(push_image(static_cast<GstClockTime>(i) * 40 * ms, 10 * (i + 1)), GST_FLOW_OK);
    EXPECT_EQ(push_frame(static_cast<GstClockTime>(i) * 40 * ms), GST_FLOW_OK);
    if (i == 0) continue;
    const auto end = static_cast<GstClockTime>(i) * 40'000;
    const auto fired = events();
    EXPECT_GT(fired.size(), 1000U);
    for (const auto& event : fired)
      EXPECT_EQ(event.first, event.microsecond < end ? 10 * i : 10 * (i + 1));
  }
}

TEST_F(ClassImages, MayComeBetweenFramesAndHave16Bits) {
  begin("GRAY16_LE");
  push_image<guint16>(0, 1000);
  push_frame(0);
  push_image<guint16>(15 * ms, 60000);
  // This one waits for the frame.
  std::thread pushing([this] { push_image<guint16>(40 * ms, 300); });
  push_frame(40 * ms);
  pushing.join();
  expect_change(events(), 15'000, 1000, 60000);
}

TEST_F(ClassImages, StayInForceAfterTheirEnd) {
  begin();
  push_frame(0);
  push_image(20 * ms, 7);
  gst_harness_push_event(images.get(), gst_event_new_eos());
  push_frame(40 * ms);
  expect_change(events(), 20'000, -1, 7);
  push_frame(80 * ms);
  const auto later = events();
  EXPECT_FALSE(later.empty());
  for (const auto& event : later) EXPECT_EQ(event.first, 7);
}

TEST_F(ClassImages, AreNotWaitedForInGaps) {
  begin();
  push_image(0, 3);
  push_frame(0);
  gst_harness_push_event(images.get(), gst_event_new_gap(40 * ms, 40 * ms));
  EXPECT_EQ(push_frame(40 * ms), GST_FLOW_OK);
  const auto fired = events();
  EXPECT_FALSE(fired.empty());
  for (const auto& event : fired) EXPECT_EQ(event.first, 3);
}

TEST_F(ClassImages, AreMatchedByRunningTime) {
  begin();
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 1000 * ms;
  gst_harness_push_event(images.get(), gst_event_new_segment(&segment));
  push_image(1000 * ms, 3);
  push_frame(0);
  push_image(1020 * ms, 8);
  gst_harness_push_event(images.get(), gst_event_new_eos());
  push_frame(40 * ms);
  expect_change(events(), 20'000, 3, 8);
}

TEST_F(ClassImages, MustHaveTheSizeOfTheVideo) {
  begin("GRAY8", "16, height=32");
  push_image(0, 1);
  push_frame(0);
  push_image(40 * ms, 2);
  EXPECT_EQ(push_frame(40 * ms), GST_FLOW_ERROR);
  EXPECT_EQ(text_of_next(GST_MESSAGE_ERROR),
            "The class images have 16x32 pixels, and the video 32x16. Scale them with videoscale "
            "method=nearest-neighbour.");
}

TEST_F(ClassImages, MustHoldTheirPixels) {
  begin();
  GstBuffer* const small = gst_buffer_new_allocate(nullptr, 100, nullptr);
  GST_BUFFER_PTS(small) = 0;
  gst_harness_push(images.get(), small);
  push_frame(0);
  push_image(40 * ms, 2);
  EXPECT_EQ(push_frame(40 * ms), GST_FLOW_ERROR);
  EXPECT_TRUE(text_of_next(GST_MESSAGE_ERROR).starts_with("Cannot read a class image: "));
}

TEST_F(ClassImages, WithoutATimeAreSkipped) {
  begin();
  push_image(10 * ms, 1);
  EXPECT_EQ(push_image(GST_CLOCK_TIME_NONE, 2), GST_FLOW_OK);
  EXPECT_EQ(push_image(5 * ms, 3), GST_FLOW_OK);
  EXPECT_EQ(text_of_next(GST_MESSAGE_WARNING),
            "Cannot match all class images to the video: one has no PTS, or an earlier one than "
            "the one before it; skipping it. Give them the timestamps of the frames that they "
            "belong to.");
  EXPECT_EQ(text_of_next(GST_MESSAGE_WARNING), "");
  gst_harness_push_event(images.get(), gst_event_new_eos());
  push_frame(0);
  push_frame(40 * ms);
  expect_change(events(), 10'000, -1, 1);
}

TEST_F(ClassImages, EndWithTheVideo) {
  begin();
  push_image(0, 1);
  push_frame(0);
  push_image(40 * ms, 2);
  gst_harness_push_event(video.get(), gst_event_new_eos());
  EXPECT_EQ(push_image(80 * ms, 3), GST_FLOW_EOS);
}

/// As when a seek with the flag SEGMENT plays a loop: the buffers of one stream are not waited for,
/// nor do those of the other wait, until the next segment.
TEST_F(ClassImages, EndWithTheSegment) {
  begin();
  push_image(0, 1);
  push_frame(0);
  gst_harness_push_event(images.get(), gst_event_new_segment_done(GST_FORMAT_TIME, 80 * ms));
  push_frame(40 * ms);
  EXPECT_FALSE(events().empty());
  gst_harness_push_event(video.get(), gst_event_new_segment_done(GST_FORMAT_TIME, 80 * ms));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.base = 80 * ms;
  for (auto* h : {images.get(), video.get()})
    gst_harness_push_event(h, gst_event_new_segment(&segment));
  push_frame(0);
  push_image(0, 5);
  push_image(20 * ms, 6);
  std::thread pushing([this] { push_image(40 * ms, 7); });
  push_frame(40 * ms);
  pushing.join();
  expect_change(events(), 20'000, 5, 6);
}

TEST_F(ClassImages, DoNotWaitForAGap) {
  begin();
  gst_harness_push_event(video.get(), gst_event_new_gap(0, 400 * ms));  // before the first frame
  for (const int at : {0, 100, 200, 300})
    EXPECT_EQ(push_image(static_cast<GstClockTime>(at) * ms, 1), GST_FLOW_OK);
  push_frame(400 * ms);
  gst_harness_push_event(video.get(), gst_event_new_gap(440 * ms, 400 * ms));
  for (const int at : {400, 500, 600, 700})
    EXPECT_EQ(push_image(static_cast<GstClockTime>(at) * ms, 1), GST_FLOW_OK);
}

TEST_F(ClassImages, AreForgottenByAFlush) {
  begin();
  push_image(0, 1);
  push_frame(0);
  push_image(40 * ms, 2);
  flush({video.get(), images.get()});
  for (auto* h : {video.get(), images.get()}) push_segment(h);
  push_image(0, 5);
  push_frame(0);
  push_image(40 * ms, 6);
  push_frame(40 * ms);
  const auto fired = events();
  EXPECT_FALSE(fired.empty());
  for (const auto& event : fired) EXPECT_EQ(event.first, event.microsecond < 40'000 ? 5 : 6);
}

TEST_F(ClassImages, AreNotSeekedIfTheVideoCannotBe) {
  begin();
  // A harness would take the seek, but does not answer that it can seek.
  gst_harness_push_upstream_event(
      video.get(), gst_event_new_seek(1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                      GST_SEEK_TYPE_NONE, -1));
  for (auto* h : {video.get(), images.get()})
    while (const Owned<GstEvent> event{gst_harness_try_pull_upstream_event(h)})
      EXPECT_NE(GST_EVENT_TYPE(event.get()), GST_EVENT_SEEK);
}

TEST_F(ClassImages, KeepTheVideoFromSeekingIfTheyCannot) {
  const auto is_seekable = [&] {
    GstQuery* const query = gst_query_new_seeking(GST_FORMAT_TIME);
    gboolean seekable = FALSE;
    EXPECT_TRUE(gst_pad_peer_query(video->sinkpad, query));
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
    gst_query_unref(query);
    return seekable != FALSE;
  };
  begin();
  make_seekable(video.get());
  EXPECT_FALSE(is_seekable());
  make_seekable(images.get());
  EXPECT_TRUE(is_seekable());
}

TEST_F(ClassImages, PadIsOnlyThereOnce) {
  auto* pad_template = gst_element_get_pad_template(dvs.element.get(), "label_sink");
  EXPECT_EQ(gst_element_request_pad(dvs.element.get(), pad_template, nullptr, nullptr), nullptr);
}

const std::string moving_ball =
    "videotestsrc pattern=ball num-buffers=20 ! video/x-raw,width=64,height=48 ! ";

TEST(ClassImagesInPipelines, DoNotKeepAPipelineFromStopping) {
  Pipeline pipeline("eventsim-dvs name=dvs ! fakesink async=false  " + moving_ball +
                    "dvs.sink  appsrc format=time caps=\"video/x-raw, format=GRAY8, width=64, "
                    "height=48, framerate=30/1\" ! dvs.label_sink");
  pipeline.set(GST_STATE_PLAYING);
  g_usleep(100'000);  // the video waits for images
  pipeline.set(GST_STATE_NULL);
}

TEST(ClassImagesInPipelines, PadCanBeReleasedWhilePlaying) {
  Pipeline pipeline("eventsim-dvs name=dvs ! fakesink name=sink sync=false  " + moving_ball +
                    "dvs.sink  appsrc format=time caps=\"video/x-raw, format=GRAY8, width=64, "
                    "height=48, framerate=30/1\" ! dvs.label_sink");
  pipeline.set(GST_STATE_PLAYING);
  g_usleep(100'000);
  GstPad* pad = gst_element_get_static_pad(pipeline["dvs"], "label_sink");
  gst_element_release_request_pad(pipeline["dvs"], pad);
  gst_object_unref(pad);
  EXPECT_TRUE(pipeline.wait()) << pipeline.error;
}

TEST(ClassImagesInPipelines, AreSeekedWithTheVideo) {
  Pipeline pipeline("eventsim-dvs name=dvs ! eventcsvenc format=labels ! fakesink sync=false  " +
                    moving_ball +
                    "dvs.sink  videotestsrc num-buffers=20 ! "
                    "video/x-raw,format=GRAY8,width=64,height=48 ! dvs.label_sink");
  ASSERT_TRUE(pipeline.reaches(GST_STATE_PAUSED));
  EXPECT_TRUE(pipeline.seek(300 * ms));
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  EXPECT_TRUE(pipeline.warnings.empty());
}

TEST(ClassImagesInPipelines, AreSeekedFromTheEndOfTheVideo) {
  const std::string frames = "video/x-raw,format=GRAY8,width=64,height=48,framerate=10/1 ! dvs.";
  Pipeline pipeline("eventsim-dvs name=dvs ! fakesink sync=false  videotestsrc num-buffers=20 ! " +
                    frames + "sink  videotestsrc num-buffers=40 ! " + frames + "label_sink");
  ASSERT_TRUE(pipeline.reaches(GST_STATE_PAUSED));
  ASSERT_TRUE(gst_element_seek(pipeline.get(), 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                               GST_SEEK_TYPE_END, -static_cast<gint64>(500 * ms),
                               GST_SEEK_TYPE_NONE, -1));
  ASSERT_TRUE(pipeline.play()) << pipeline.error;
  for (const char* name : {"sink", "label_sink"}) {
    const Owned<GstPad> pad(gst_element_get_static_pad(pipeline["dvs"], name));
    const Owned<GstEvent> event(gst_pad_get_sticky_event(pad.get(), GST_EVENT_SEGMENT, 0));
    GstSegment segment;
    gst_event_copy_segment(event.get(), &segment);
    EXPECT_EQ(segment.start, 1500 * ms) << name;
  }
}

/// After the end, the video's thread does not tell how far the images may go until it is flushed.
TEST(ClassImagesInPipelines, AreSeekedBeforeASlowVideo) {
  const std::string frames = "videotestsrc ! video/x-raw,format=GRAY8,width=64,height=48 ! ";
  Pipeline pipeline("eventsim-dvs name=dvs ! fakesink sync=false  " + frames + "dvs.sink  " +
                    frames + "dvs.label_sink");
  const Owned<GstPad> video(gst_element_get_static_pad(pipeline["dvs"], "sink"));
  gst_pad_add_probe(
      video.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM,
      [](GstPad*, GstPadProbeInfo* info, gpointer) {
        if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_SEEK) g_usleep(100'000);
        return GST_PAD_PROBE_OK;
      },
      nullptr, nullptr);
  const Owned<GstPad> images(gst_element_get_static_pad(pipeline["dvs"], "label_sink"));
  std::atomic<int> count = 0;
  gst_pad_add_probe(
      images.get(), GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        ++*static_cast<std::atomic<int>*>(data);
        return GST_PAD_PROBE_OK;
      },
      &count, nullptr);
  ASSERT_TRUE(pipeline.reaches(GST_STATE_PAUSED));
  for (int times = 0; times < 2; ++times) {
    count = 0;
    ASSERT_TRUE(pipeline.seek(0, 1000 * ms));
    ASSERT_TRUE(pipeline.play()) << pipeline.error;
    EXPECT_GE(count, 30);
  }
  EXPECT_TRUE(pipeline.warnings.empty());
}

/// Lines of a CSV file of labelled events: the numbers of each.
std::vector<std::vector<int>> rows_of(const std::string& launch, const std::string& branch = "") {
  // The class is the place: 1 + x + 64 y.
  std::vector<guint16> places(std::size_t{64} * 48);
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = static_cast<guint16>(i + 1);
  const TemporaryFile file;
  Pipeline pipeline("eventsim-dvs name=dvs preset=davis346 shot-noise-rate=20 ! " + launch +
                    " ! eventcsvenc format=labels" + file.sink() + "  " + moving_ball +
                    "dvs.sink  appsrc name=images format=time caps=\"video/x-raw, "
                    "format=GRAY16_LE, width=64, height=48, framerate=30/1\" ! dvs.label_sink  " +
                    branch);
  GstBuffer* image = gst_buffer_new_memdup(places.data(), places.size() * sizeof(guint16));
  GST_BUFFER_PTS(image) = 0;
  GstFlowReturn flow = GST_FLOW_ERROR;
  g_signal_emit_by_name(pipeline["images"], "push-buffer", image, &flow);
  gst_buffer_unref(image);
  g_signal_emit_by_name(pipeline["images"], "end-of-stream", &flow);
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  const auto bytes = file.bytes();
  std::istringstream lines(std::string(bytes.begin(), bytes.end()));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "t,x,y,p,cause,class");
  std::vector<std::vector<int>> rows;
  while (std::getline(lines, line)) {
    rows.emplace_back();
    std::istringstream numbers(line);
    for (std::string number; std::getline(numbers, number, ',');)
      rows.back().push_back(std::stoi(number));
  }
  EXPECT_GT(rows.size(), 100U) << launch;
  return rows;
}

TEST(ClassImagesInPipelines, StayWithTheirEventsInFilters) {
  for (const char* filter :
       {"identity", "eventantiflicker", "eventdenoise", "eventhotpixel", "eventrefractory",
        "eventtrail", "eventratecontrol max-rate=2000", "eventpolarity"})
    for (const auto& row : rows_of(filter)) ASSERT_EQ(row[5], 1 + row[1] + 64 * row[2]) << filter;
}

TEST(ClassImagesInPipelines, StayWithTheirEventsThatMove) {
  for (const auto& row : rows_of("eventflip video-direction=180 ! eventcrop left=8 top=4"))
    ASSERT_EQ(row[5], 1 + (63 - row[1] - 8) + 64 * (47 - row[2] - 4));
  for (const auto& row : rows_of("eventscale ! application/x-event-camera,width=32,height=24")) {
    ASSERT_EQ((row[5] - 1) % 64 / 2, row[1]);
    ASSERT_EQ((row[5] - 1) / 64 / 2, row[2]);
  }
}

TEST(ClassImagesInPipelines, StayWithTheirEventsInMergedStreams) {
  int without = 0;
  for (const auto& row :
       rows_of("eventmerge name=m", moving_ball + "eventsim-dvs label=true ! m.")) {
    without += row[5] == 0 ? 1 : 0;
    ASSERT_TRUE(row[5] == 0 || row[5] == 1 + row[1] + 64 * row[2]);
  }
  EXPECT_GT(without, 0);
}

}  // namespace
