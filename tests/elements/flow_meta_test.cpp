// SPDX-License-Identifier: LGPL-2.1-or-later
/// Optical flow of a frame: GstEventCameraFlowMeta.
#include <gst/check/gstharness.h>
#include <gtest/gtest.h>

#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "gst/eventcamera/eventcamera.h"
#include "tests/elements/harness.hpp"

namespace {

class FlowMeta : public testing::Test {
 protected:
  static constexpr guint width = 4;
  static constexpr guint height = 3;
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }

  /// The numbers `first`, `first` + 1 ...
  static GBytes* numbers(float first, gsize count) {
    std::vector<float> flow;
    for (gsize i = 0; i < count; ++i) flow.push_back(first + static_cast<float>(i));
    return g_bytes_new(flow.data(), flow.size() * sizeof flow[0]);
  }

  static harness::Buffer frame_with_flow(float first = 0) {
    harness::Buffer frame(gst_buffer_new_allocate(nullptr, gsize{width} * height, nullptr));
    gst_buffer_memset(frame.get(), 0, 0, gsize{width} * height);
    add(frame.get(), first);
    return frame;
  }

  static void add(GstBuffer* frame, float first) {
    GBytes* const flow = numbers(first, gsize{width} * height * 2);
    const auto* meta = gst_buffer_add_event_camera_flow_meta(frame, width, height, flow);
    EXPECT_NE(meta, nullptr);
    EXPECT_EQ(gst_event_camera_flow_meta_get_flow(meta), flow) << "not copied";
    g_bytes_unref(flow);
  }

  static void expect_flow(GstBuffer* frame, float first = 0) {
    const auto* meta = gst_buffer_get_event_camera_flow_meta(frame);
    ASSERT_NE(meta, nullptr);
    EXPECT_EQ(meta->width, width);
    EXPECT_EQ(meta->height, height);
    GBytes* const expected = numbers(first, gsize{width} * height * 2);
    EXPECT_TRUE(g_bytes_equal(gst_event_camera_flow_meta_get_flow(meta), expected));
    g_bytes_unref(expected);
  }

  /// Pushes a frame with flow through an element.
  static harness::Buffer through(const std::string& line) {
    harness::Harness h(line);
    h.caps("video/x-raw,format=GRAY8,width=4,height=3,framerate=30/1", "video/x-raw");
    EXPECT_EQ(h.push(frame_with_flow().release()), GST_FLOW_OK);
    return h.pull();
  }
};

TEST_F(FlowMeta, IsAddedOnceToAFrame) {
  const harness::Buffer bare(gst_buffer_new());
  EXPECT_EQ(gst_buffer_get_event_camera_flow_meta(bare.get()), nullptr);
  const auto frame = frame_with_flow();
  expect_flow(frame.get());
  add(frame.get(), 100);
  expect_flow(frame.get(), 100);
  EXPECT_EQ(gst_buffer_get_n_meta(frame.get(), GST_EVENT_CAMERA_FLOW_META_API_TYPE), 1U);
}

TEST_F(FlowMeta, StaysWithCopiesOfTheFrame) {
  harness::Buffer frame = frame_with_flow();
  const harness::Buffer copy(gst_buffer_copy(frame.get()));
  const harness::Buffer deep_copy(gst_buffer_copy_deep(frame.get()));
  const harness::Buffer part(
      gst_buffer_copy_region(frame.get(), GST_BUFFER_COPY_ALL, width, width));
  add(frame.get(), 100);
  frame.reset();
  expect_flow(copy.get());
  expect_flow(deep_copy.get());
  EXPECT_EQ(gst_buffer_get_event_camera_flow_meta(part.get()), nullptr);
}

TEST_F(FlowMeta, StaysWhilePixelsStayInTheirPlace) {
  expect_flow(through("videoconvert ! capsfilter caps=video/x-raw,format=BGRx").get());
  expect_flow(through("videoscale ! capsfilter caps=video/x-raw,width=4,height=3").get());
  for (const char* line :
       {"videoscale ! capsfilter caps=video/x-raw,width=8,height=3",
        "videoscale ! capsfilter caps=video/x-raw,width=4,height=6", "videocrop left=1"}) {
    const auto out = through(line);
    EXPECT_EQ(gst_buffer_get_event_camera_flow_meta(out.get()), nullptr) << line;
  }
}

TEST_F(FlowMeta, IsAlignedForFloats) {
  const harness::Buffer frame(gst_buffer_new());
  const float motion[] = {1.5F, -2};
  std::vector<std::byte> bytes(1 + sizeof motion);
  std::memcpy(bytes.data() + 1, motion, sizeof motion);
  GBytes* const odd = g_bytes_new_static(bytes.data() + 1, sizeof motion);
  auto* meta = gst_buffer_add_event_camera_flow_meta(frame.get(), 1, 1, odd);
  g_bytes_unref(odd);
  gconstpointer const data = g_bytes_get_data(gst_event_camera_flow_meta_get_flow(meta), nullptr);
  EXPECT_EQ(GPOINTER_TO_SIZE(data) % alignof(float), 0U);
  EXPECT_EQ(std::memcmp(data, motion, sizeof motion), 0);
}

TEST_F(FlowMeta, RefusesOtherSizes) {
  const auto fatal = g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK));
  const harness::Buffer frame(gst_buffer_new());
  const auto add_of = [&](guint of_width, guint of_height, gsize count) {
    GBytes* const flow = numbers(0, count);
    const auto* meta =
        gst_buffer_add_event_camera_flow_meta(frame.get(), of_width, of_height, flow);
    g_bytes_unref(flow);
    return meta;
  };
  EXPECT_EQ(add_of(0, 3, 0), nullptr);
  EXPECT_EQ(add_of(4, 0, 0), nullptr);
  EXPECT_EQ(add_of(4, 3, 12), nullptr);
  EXPECT_EQ(add_of(4, 3, 25), nullptr);
  EXPECT_EQ(add_of(GST_EVENT_CAMERA_MAX_SIDE + 1, 1, 2 * (GST_EVENT_CAMERA_MAX_SIDE + 1)), nullptr);
  EXPECT_EQ(add_of(1, GST_EVENT_CAMERA_MAX_SIDE + 1, 2 * (GST_EVENT_CAMERA_MAX_SIDE + 1)), nullptr);
  EXPECT_EQ(gst_buffer_add_event_camera_flow_meta(frame.get(), 4, 3, nullptr), nullptr);
  EXPECT_EQ(gst_buffer_get_event_camera_flow_meta(frame.get()), nullptr);
  g_log_set_always_fatal(fatal);
}

}  // namespace
