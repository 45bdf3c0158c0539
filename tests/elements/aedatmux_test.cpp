// SPDX-License-Identifier: LGPL-2.1-or-later
// aedatmux, fed by the test.
#include <numeric>

#include "tests/elements/aedat_recordings.hpp"
#include "tests/elements/event_buffer.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

/// Waits for the end of the file, and returns what was not pulled before.
Content rest_of_file(GstHarness* h) {
  Bytes bytes;
  for (const auto& buffer : pull_until_eos(h)) {
    const auto piece = bytes_of(buffer.get());
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
  return Content(bytes);
}

/// Pushes a segment in which this timestamp has this running time.
void push_segment(GstHarness* h, GstClockTime pts, GstClockTime running_time, double rate = 1) {
  harness::push_segment(h, {.start = pts, .time = pts, .base = running_time, .rate = rate});
}

/// The muxer with one sink pad.
struct Mux : Harness {
  Mux(const char* pad, const char* caps) : Harness("aedatmux", pad, "src") {
    gst_harness_set_src_caps_str(get(), caps);
  }
  Mux()
      : Mux("events_0",
            "application/x-event-camera, format=XYTP, width=346, height=260, framerate=0/1") {}

  GstFlowReturn push(GstClockTime pts, const std::vector<Event>& events) {
    return Harness::push(buffer_of(pts, events, 10 * GST_MSECOND));
  }

  /// Ends the file, and returns what is not pulled yet.
  Content end() {
    push_eos(get());
    return rest_of_file(get());
  }
};

TEST(AedatMux, WritesTheTimesOfTheStream) {
  Mux mux;
  EXPECT_EQ(mux.push(5 * GST_SECOND + 999, {{0, 1, 2}, {7, 3, 0x8004}}), GST_FLOW_OK);
  EXPECT_EQ(mux.push(5 * GST_SECOND + 10 * GST_MSECOND, {{9'999, 345, 259}}), GST_FLOW_OK);
  const auto content = mux.end();
  EXPECT_EQ(content.events,
            (Events{off_at(1, 2, 5'000'000), on_at(3, 4, 5'000'007), off_at(345, 259, 5'019'999)}));
  EXPECT_FALSE(content.has_table) << "nothing could seek to where the header tells of it";
}

/// As when the clock of a camera is corrected: first the running time is late, then early.
TEST(AedatMux, WritesTheTimesOfTheStreamInEachSegment) {
  Mux mux;
  EXPECT_EQ(mux.push(0, {{0, 1, 2}, {9'999, 3, 4}}), GST_FLOW_OK);
  push_segment(mux.get(), 10 * GST_MSECOND, 12 * GST_MSECOND);
  EXPECT_EQ(mux.push(10 * GST_MSECOND, {{0, 1, 2}, {9'999, 3, 4}}), GST_FLOW_OK);
  push_segment(mux.get(), 20 * GST_MSECOND, 18 * GST_MSECOND);
  EXPECT_EQ(mux.push(20 * GST_MSECOND, {{0, 1, 2}, {9'999, 3, 4}}), GST_FLOW_OK);
  Events expected;
  for (int start = 0; start < 30'000; start += 10'000) {
    expected.push_back(off_at(1, 2, start));
    expected.push_back(off_at(3, 4, start + 9'999));
  }
  EXPECT_EQ(mux.end().events, expected);
}

/// aedatmux with events and frames as its two inputs.
struct EventsAndVideo : TwoInputs {
  EventsAndVideo() : TwoInputs("aedatmux", "events_0", "video_0") {
    gst_harness_set_src_caps_str(
        first.get(), "application/x-event-camera, format=XYTP, width=8, height=4, framerate=0/1");
    gst_harness_set_src_caps_str(second.get(),
                                 "video/x-raw, format=GRAY8, width=4, height=4, framerate=0/1");
  }

  void push_events(GstClockTime pts) const {
    EXPECT_EQ(gst_harness_push(first.get(), buffer_of(pts, {{0, 1, 2}}, 10 * GST_MSECOND)),
              GST_FLOW_OK);
  }

  Content content() const {
    end();
    return rest_of_file(first.get());
  }

  void push_frame(GstClockTime pts) const {
    EXPECT_EQ(gst_harness_push(second.get(), filled(16, 7, pts, GST_CLOCK_TIME_NONE)), GST_FLOW_OK);
  }
};

TEST(AedatMux, WritesFramesWithTheEventsOfTheirRunningTime) {
  const EventsAndVideo mux;
  auto* const events = mux.first.get();
  auto* const video = mux.second.get();
  push_segment(events, 5 * GST_SECOND, 0, 2);
  push_segment(video, GST_SECOND, 0);
  mux.push_events(5 * GST_SECOND);
  mux.push_frame(GST_SECOND + 4 * GST_MSECOND);
  push_segment(events, 5 * GST_SECOND + 10 * GST_MSECOND, 5 * GST_MSECOND);
  mux.push_events(5 * GST_SECOND + 10 * GST_MSECOND);
  mux.push_frame(GST_SECOND + 7 * GST_MSECOND);
  const auto content = mux.content();
  ASSERT_EQ(content.pictures.size(), 2U);
  EXPECT_EQ(content.pictures[0].times[0], 5'008'000);
  EXPECT_EQ(content.pictures[1].times[0], 5'012'000);
  EXPECT_EQ(content.events, (Events{off_at(1, 2, 5'000'000), off_at(1, 2, 5'010'000)}));
}

/// At twice the rate, a gap of 40 ms ends before a frame of running time 30 ms.
TEST(AedatMux, WritesEventsAfterAGapBeforeLaterFrames) {
  const EventsAndVideo mux;
  auto* const events = mux.first.get();
  push_segment(events, 0, 0, 2);
  push_gap(events, 0, 40 * GST_MSECOND);
  mux.push_frame(30 * GST_MSECOND);
  push_segment(events, 40 * GST_MSECOND, 20 * GST_MSECOND);
  mux.push_events(40 * GST_MSECOND);
  const auto content = mux.content();
  ASSERT_EQ(content.pictures.size(), 1U);
  EXPECT_EQ(content.pictures[0].times[0], 50'000) << "the segment of the events after the gap";
}

TEST(AedatMux, LeavesOutWhatDoesNotFit) {
  Mux mux;
  EXPECT_EQ(mux.push(GST_SECOND, {{0, 346, 2}, {1, 3, 260}, {5, 6, 7}, {4, 6, 7}}), GST_FLOW_OK);
  EXPECT_EQ(mux.push(GST_CLOCK_TIME_NONE, {{0, 1, 1}}), GST_FLOW_OK);
  EXPECT_EQ(mux.push(0, {{0, 1, 1}}), GST_FLOW_OK);
  EXPECT_EQ(mux.Harness::push(gst_buffer_new_memdup("123", 3)), GST_FLOW_OK);
  EXPECT_EQ(mux.push(2 * GST_SECOND, {{0, 1, 1}}), GST_FLOW_OK);
  EXPECT_EQ(mux.end().events, (Events{off_at(6, 7, 1'000'005), off_at(1, 1, 2'000'000)}));
  for (const char* dropped :
       {"a buffer without a timestamp", "2 events earlier than", "2 events outside"}) {
    const auto warning = mux.warning();
    EXPECT_TRUE(warning.starts_with(std::string("Dropped ") + dropped)) << warning;
  }
  EXPECT_EQ(mux.warning(), "");
}

TEST(AedatMux, WritesFramesInTheSizeOfTheirCaps) {
  Mux mux("video_0", "video/x-raw, format=GRAY8, width=4, height=3, framerate=0/1");
  // Rows of 16 bytes; the meta's frame is larger than the memory.
  Bytes pixels(3 * 16);
  std::iota(pixels.begin(), pixels.end(), std::uint8_t{0});
  GstBuffer* const buffer = gst_buffer_new_memdup(pixels.data(), pixels.size());
  add_video_meta(buffer, GST_VIDEO_FORMAT_GRAY8, 16, 999, {{0, 16}});
  GST_BUFFER_PTS(buffer) = GST_SECOND;
  EXPECT_EQ(mux.Harness::push(buffer), GST_FLOW_OK);
  const auto pictures = mux.end().pictures;
  ASSERT_EQ(pictures.size(), 1U);
  EXPECT_EQ(pictures[0].box, (std::array{4, 3, 0, 0}));
  EXPECT_EQ(pictures[0].pixels, (Bytes{0, 1, 2, 3, 16, 17, 18, 19, 32, 33, 34, 35}));
}

/// Pads come and go while another thread writes the header.
TEST(AedatMux, TakesNoPadOnceTheHeaderIsWritten) {
  Mux mux;
  const auto request_pad = [&] {
    GstPad* const pad = gst_element_request_pad_simple(mux.element(), "video_%u");
    if (pad == nullptr) return false;
    gst_element_release_request_pad(mux.element(), pad);
    gst_object_unref(pad);
    return true;
  };
  EXPECT_EQ(mux.push(GST_SECOND, {{0, 1, 2}}), GST_FLOW_OK);
  while (request_pad()) continue;
  EXPECT_TRUE(Buffer(gst_harness_pull(mux.get())));  // the header
  EXPECT_FALSE(request_pad());
  flush({mux.get()});
  EXPECT_TRUE(request_pad());
}

TEST(AedatMux, DoesNotCollectTriggersWithoutEvents) {
  Mux mux;
  std::vector<Trigger> triggers;
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 10'000; ++j)
      triggers.push_back({10 * static_cast<Microseconds>(triggers.size()), 1, j % 2 == 0});
    EXPECT_TRUE(gst_harness_push_event(mux.get(), event_of(std::span(triggers).last<10'000>())));
  }
  mux.wait_for_events();
  EXPECT_GT(gst_harness_buffers_in_queue(mux.get()), 1U);
  EXPECT_EQ(mux.end().triggers, triggers);
}

TEST(AedatMux, HasOnePadOfAKind) {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> mux(gst_element_factory_make("aedatmux", nullptr));
  GstPad* const events = gst_element_request_pad_simple(mux.get(), "events_%u");
  GstPad* const video = gst_element_request_pad_simple(mux.get(), "video_7");
  ASSERT_NE(events, nullptr);
  ASSERT_NE(video, nullptr);
  EXPECT_STREQ(GST_PAD_NAME(events), "events_0");
  EXPECT_STREQ(GST_PAD_NAME(video), "video_7");
  GstPadTemplate* const of_events = gst_pad_get_pad_template(events);
  EXPECT_EQ(gst_element_request_pad(mux.get(), of_events, nullptr, nullptr), nullptr);
  gst_object_unref(of_events);
  for (GstPad* pad : {events, video}) {
    gst_element_release_request_pad(mux.get(), pad);
    gst_object_unref(pad);
  }
}

}  // namespace
