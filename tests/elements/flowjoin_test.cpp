// SPDX-License-Identifier: LGPL-2.1-or-later
// flowjoin: which frame gets which optical flow, and what it waits for.
#include <optional>
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

constexpr GstClockTime ms = GST_MSECOND;

class FlowJoin : public testing::Test {
 protected:
  void begin(const std::string& dimensions = "2:4:3:1", const std::string& framerate = "25/1",
             const std::string& size = "4, height=3") {
    gst_harness_set_src_caps_str(
        video.get(),
        ("video/x-raw, format=GRAY8, framerate=" + framerate + ", width=" + size).c_str());
    gst_harness_set_src_caps_str(
        flow.get(), ("other/tensors, format=static, num_tensors=1, types=float32, framerate=25/1, "
                     "dimensions=" +
                     dimensions)
                        .c_str());
  }

  GstFlowReturn push_frame(GstClockTime pts, GstClockTime duration = 40 * ms) {
    return gst_harness_push(video.get(), filled(12, 100, pts, duration));
  }

  /// Flow that is the same for each pixel.
  GstFlowReturn push_flow(GstClockTime pts, float motion, GstClockTime duration = 40 * ms,
                          gsize pixels = 12) {
    const std::vector<float> numbers(2 * pixels, motion);
    GstBuffer* buffer = gst_buffer_new_memdup(numbers.data(), numbers.size() * sizeof numbers[0]);
    GST_BUFFER_PTS(buffer) = pts;
    GST_BUFFER_DURATION(buffer) = duration;
    return gst_harness_push(flow.get(), buffer);
  }

  /// Flow of the next frame.
  std::optional<float> joined() {
    const Buffer frame(gst_harness_pull(video.get()));
    if (!frame) {
      ADD_FAILURE() << "no frame";
      return std::nullopt;
    }
    EXPECT_EQ(bytes_of(frame.get()), std::string(12, 100));
    last_pts = GST_BUFFER_PTS(frame.get());
    const auto* meta = gst_buffer_get_event_camera_flow_meta(frame.get());
    if (meta == nullptr) return std::nullopt;
    EXPECT_EQ(meta->width * meta->height, 12U);
    gsize size = 0;
    const auto* numbers = static_cast<const float*>(
        g_bytes_get_data(gst_event_camera_flow_meta_get_flow(meta), &size));
    EXPECT_EQ(size, 12 * 2 * sizeof(float));
    return numbers[23];
  }

  TwoInputs join{"flowjoin", "video_sink", "flow_sink"};
  Owned<GstHarness>& video = join.first;
  Owned<GstHarness>& flow = join.second;
  GstClockTime last_pts = 0;
};

constexpr auto none = std::nullopt;

TEST_F(FlowJoin, AddsTheFlowThatBeginsWithAFrame) {
  begin();
  push_frame(0);
  push_flow(999, 1.5);  // as streams round times differently
  EXPECT_EQ(joined(), 1.5F);
  push_flow(40 * ms, 2);
  push_frame(40 * ms);
  EXPECT_EQ(joined(), 2.F);
  EXPECT_EQ(last_pts, 40 * ms);
  EXPECT_EQ(join.warning(), "");
}

TEST_F(FlowJoin, PassesFramesWithoutFlow) {
  begin();
  push_frame(0);
  push_flow(40 * ms, 1);
  EXPECT_EQ(joined(), none);
  EXPECT_TRUE(join.warning().starts_with("A frame has no optical flow;"));
  push_frame(40 * ms);
  EXPECT_EQ(joined(), 1.F);
  push_flow(60 * ms, 2);  // of no frame
  push_frame(80 * ms);
  push_flow(80 * ms, 3);
  EXPECT_EQ(joined(), 3.F);
  push_gap(flow.get(), 120 * ms, 80 * ms);
  push_frame(120 * ms);
  EXPECT_EQ(joined(), none);
  push_frame(160 * ms);
  EXPECT_EQ(joined(), none);
  push_frame(200 * ms);
  push_flow(200 * ms, 4);
  EXPECT_EQ(joined(), 4.F);
  EXPECT_EQ(join.warning(), "");
}

TEST_F(FlowJoin, SkipsFlowOfOtherDurations) {
  for (const char* framerate : {"25/1", "0/1"}) {
    const bool is_known = framerate[0] != '0';
    begin("2:4:3", framerate);
    join.start_over();
    GstClockTime at = 0;
    for (const auto& [duration, fits] : {std::pair{20 * ms, false},
                                         {21 * ms, true},
                                         {59 * ms, true},
                                         {60 * ms, false},
                                         {GST_CLOCK_TIME_NONE, true}}) {
      push_frame(at, GST_CLOCK_TIME_NONE);
      push_flow(at, 1, duration);
      EXPECT_EQ(joined().has_value(), fits || !is_known) << duration;
      at += 40 * ms;
    }
    push_frame(at, 80 * ms);
    push_flow(at, 1, 40 * ms);
    EXPECT_EQ(joined(), none);
  }
}

TEST_F(FlowJoin, GoesOnAfterTheEndOfFlow) {
  begin();
  push_frame(0);
  push_flow(0, 1);
  EXPECT_EQ(joined(), 1.F);
  push_eos(flow.get());
  for (const auto pts : {40 * ms, 80 * ms}) {
    push_frame(pts);
    EXPECT_EQ(joined(), none);
  }
  EXPECT_EQ(join.warning(), "") << "no flow begins with the last frame";
  push_eos(video.get());
  EXPECT_TRUE(pull_until_eos(video.get()).empty());
}

TEST_F(FlowJoin, NeedsFlowOfTheSizeOfTheVideo) {
  begin("2:3:4");
  push_frame(0);
  push_flow(0, 1);
  EXPECT_TRUE(contains(join.error(), "2:3:4, and the video needs 2:4:3:1"));
  join.start_over();
  begin();
  push_frame(0);
  push_flow(0, 1, 40 * ms, 11);
  EXPECT_TRUE(contains(join.error(), "88 bytes instead of 96"));
}

TEST_F(FlowJoin, FollowsChangesOfTheSize) {
  begin();
  push_frame(0);
  push_flow(0, 1);
  EXPECT_EQ(joined(), 1.F);
  begin("2:6:2:1", "25/1", "6, height=2");
  push_frame(40 * ms);
  push_flow(40 * ms, 2);
  EXPECT_EQ(joined(), 2.F);
}

TEST_F(FlowJoin, PassesGapsOn) {
  begin();
  push_frame(0);
  push_flow(0, 1);
  EXPECT_EQ(joined(), 1.F);
  push_gap(video.get(), 40 * ms, 40 * ms);
  push_flow(40 * ms, 2);
  push_flow(80 * ms, 3);
  push_frame(80 * ms);
  EXPECT_EQ(joined(), 3.F);
  EXPECT_TRUE(next_event(video.get(), GST_EVENT_GAP));
}

TEST_F(FlowJoin, StartsOverAfterAFlush) {
  begin();
  push_flow(0, 1);
  join.start_over();
  push_frame(0);
  push_flow(0, 2);
  EXPECT_EQ(joined(), 2.F);
}

/// Live video, and flow that never comes.
TEST(LiveFlowJoin, WaitsNoLongerThanTheLatency) {
  Pipeline pipeline(
      "videotestsrc is-live=true num-buffers=10 ! video/x-raw,width=64,height=48,framerate=50/1 ! "
      "flowjoin name=join ! fakesink name=sink sync=true  appsrc is-live=true format=time "
      "caps=\"other/tensors, format=static, num_tensors=1, types=float32, dimensions=2:64:48:1, "
      "framerate=50/1\" ! queue ! join.flow_sink");
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  EXPECT_EQ(pipeline.stat("sink", "rendered"), 10U);
}

}  // namespace
