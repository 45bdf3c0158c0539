// SPDX-License-Identifier: LGPL-2.1-or-later
// The C API: events of buffers, caps, labels, optical flow, triggers and IMU samples.
#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "tests/elements/event_buffer.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

struct UnrefBytes {
  void operator()(GBytes* bytes) const { g_bytes_unref(bytes); }
};
using Bytes = std::unique_ptr<GBytes, UnrefBytes>;

template <class Record>
Bytes bytes_of(const std::vector<Record>& records) {
  return Bytes(g_bytes_new(records.data(), records.size() * sizeof(Record)));
}

class Api : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }
};

/* events */

TEST_F(Api, MapsEventsAtAnyAddress) {
  const guint8 bytes[] = {0, 1, 0, 0, 0, 2, 0, 3, 0x80};
  GstBuffer* whole = gst_buffer_new_memdup(bytes, sizeof bytes);
  GstBuffer* odd = gst_buffer_copy_region(whole, GST_BUFFER_COPY_MEMORY, 1, 8);
  GST_BUFFER_PTS(odd) = 5 * GST_MSECOND + 999;
  GstEventCameraMap map;
  ASSERT_TRUE(gst_event_camera_map(&map, odd));
  ASSERT_EQ(map.n_events, 1U);
  EXPECT_EQ(map.start, 5000U);
  EXPECT_EQ(GPOINTER_TO_SIZE(map.events) % alignof(GstEventCameraEvent), 0U);
  EXPECT_EQ(map.events[0].t, 1U);
  EXPECT_EQ(map.events[0].x, 2);
  EXPECT_EQ(gst_event_camera_event_get_y(&map.events[0]), 3U);
  EXPECT_TRUE(gst_event_camera_event_is_on(&map.events[0]));
  gst_event_camera_unmap(&map);
  gst_buffer_set_size(odd, 7);
  EXPECT_FALSE(gst_event_camera_map(&map, odd));  // partial event
  gst_buffer_unref(odd);
  GST_BUFFER_PTS(whole) = GST_CLOCK_TIME_NONE;
  gst_buffer_set_size(whole, 8);
  EXPECT_FALSE(gst_event_camera_map(&map, whole));  // no time
  gst_buffer_unref(whole);
}

TEST_F(Api, ReadsAndWritesCaps) {
  const auto read = [](const char* text, GstEventCameraInfo* info) {
    Owned<GstCaps> caps(gst_caps_from_string(text));
    return gst_event_camera_info_from_caps(info, caps.get()) == TRUE;
  };
  GstEventCameraInfo info;
  ASSERT_TRUE(
      read("application/x-event-camera,format=XYTP,width=640,height=480,framerate=30/1", &info));
  EXPECT_EQ(info.width, 640);
  EXPECT_EQ(info.height, 480);
  EXPECT_EQ(info.fps_n, 30);
  Owned<GstCaps> caps(gst_event_camera_info_to_caps(&info));
  GstEventCameraInfo back;
  ASSERT_TRUE(gst_event_camera_info_from_caps(&back, caps.get()));
  EXPECT_EQ(back.height, 480);
  info.fps_d = 0;
  caps.reset(gst_event_camera_info_to_caps(&info));
  ASSERT_TRUE(gst_event_camera_info_from_caps(&back, caps.get()));
  EXPECT_EQ(back.fps_n, 0);
  EXPECT_EQ(back.fps_d, 1);
  EXPECT_TRUE(read("application/x-event-camera,format=XYTP,width=1,height=1", &info));
  EXPECT_EQ(info.fps_n, 0);
  EXPECT_EQ(info.fps_d, 1);
  EXPECT_FALSE(read("application/x-event-camera,format=EVT3,width=640,height=480", &info));
  EXPECT_FALSE(read("application/x-event-camera,format=XYTP,width=640", &info));
  EXPECT_FALSE(read("application/x-event-camera,format=XYTP,width=0,height=480", &info));
  EXPECT_FALSE(read("application/x-event-camera,format=XYTP,width=1,height=32769", &info));
  EXPECT_FALSE(read("video/x-raw,format=GRAY8,width=640,height=480", &info));
}

/* labels */

class LabelMeta : public Api {
 protected:
  static constexpr gsize count = 5;

  /// Events 0 ... 4, whose labels have their index as class and cause.
  static Buffer labelled_buffer() {
    std::vector<GstEventCameraLabel> labels;
    for (guint8 i = 0; i < count; ++i) labels.push_back({i, i, 0});
    Buffer buffer(buffer_of(0, std::vector<Event>(count), GST_MSECOND));
    EXPECT_NE(gst_buffer_add_event_camera_label_meta(buffer.get(), labels.data(), count), nullptr);
    return buffer;
  }

  static void expect_labels(GstBuffer* buffer, std::vector<guint> expected) {
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer);
    ASSERT_NE(meta, nullptr);
    ASSERT_EQ(meta->n_labels, expected.size());
    for (gsize i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(meta->labels[i].object_class, expected[i]);
      EXPECT_EQ(meta->labels[i].cause, expected[i]);
      EXPECT_EQ(meta->labels[i].reserved, 0);
    }
  }
};

TEST_F(LabelMeta, IsZeroUnlessItIsGiven) {
  const Buffer buffer(buffer_of(0, std::vector<Event>(3), GST_MSECOND));
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(buffer.get()), nullptr);
  gst_buffer_add_event_camera_label_meta(buffer.get(), nullptr, 3);
  expect_labels(buffer.get(), {0, 0, 0});
}

TEST_F(LabelMeta, IsCopiedWithItsBuffer) {
  const auto buffer = labelled_buffer();
  const Buffer copy(gst_buffer_copy(buffer.get()));
  gst_buffer_get_event_camera_label_meta(copy.get())->labels[0].object_class = 77;
  expect_labels(buffer.get(), {0, 1, 2, 3, 4});
  const Buffer deep_copy(gst_buffer_copy_deep(buffer.get()));
  expect_labels(deep_copy.get(), {0, 1, 2, 3, 4});
}

TEST_F(LabelMeta, OfAPartHasTheLabelsOfItsEvents) {
  const auto buffer = labelled_buffer();
  const auto part = [&](gsize offset, gsize size) {
    return Buffer(gst_buffer_copy_region(buffer.get(), GST_BUFFER_COPY_ALL, offset, size));
  };
  expect_labels(part(8, 24).get(), {1, 2, 3});
  expect_labels(part(32, 8).get(), {4});
  expect_labels(part(16, G_MAXSIZE).get(), {2, 3, 4});
  expect_labels(part(40, 0).get(), {});
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(part(4, 24).get()), nullptr);
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(part(8, 20).get()), nullptr);
}

TEST_F(LabelMeta, IsTruncatedWithTheBuffer) {
  const auto buffer = labelled_buffer();
  gst_event_camera_label_meta_truncate(gst_buffer_get_event_camera_label_meta(buffer.get()), 2);
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(buffer.get()), nullptr)
      << "not one label an event";
  gst_buffer_set_size(buffer.get(), 2 * sizeof(GstEventCameraEvent));
  expect_labels(buffer.get(), {0, 1});
}

TEST_F(LabelMeta, IsIgnoredUnlessItHasALabelForEachEvent) {
  const auto buffer = labelled_buffer();
  gst_buffer_append(buffer.get(), labelled_buffer().release());
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(buffer.get()), nullptr);
  // A part past the end of the labels has none.
  const Buffer part(gst_buffer_copy_region(buffer.get(), GST_BUFFER_COPY_ALL, 56, 16));
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(part.get()), nullptr);
}

TEST_F(LabelMeta, IsReadAndWrittenAsBytes) {
  const auto buffer = labelled_buffer();
  const Bytes bytes(
      gst_event_camera_label_meta_get_bytes(gst_buffer_get_event_camera_label_meta(buffer.get())));
  ASSERT_EQ(g_bytes_get_size(bytes.get()), 4 * count);
  const unsigned char expected[] = {3, 0, 3, 0};
  const auto* const data = static_cast<const char*>(g_bytes_get_data(bytes.get(), nullptr));
  EXPECT_EQ(std::memcmp(data + 12, expected, 4), 0);
  const Buffer other(gst_buffer_new_allocate(nullptr, 8 * count, nullptr));
  gst_buffer_add_event_camera_label_bytes(other.get(), bytes.get());
  expect_labels(other.get(), {0, 1, 2, 3, 4});
}

/* optical flow */

class FlowMeta : public Api {
 protected:
  static constexpr guint width = 4;
  static constexpr guint height = 3;

  /// The numbers `first`, `first` + 1 ...
  static Bytes numbers(float first, gsize count) {
    std::vector<float> flow;
    for (gsize i = 0; i < count; ++i) flow.push_back(first + static_cast<float>(i));
    return bytes_of(flow);
  }

  static Buffer frame_with_flow() {
    Buffer frame(filled(gsize{width} * height, 0, 0, GST_MSECOND));
    add(frame.get(), 0);
    return frame;
  }

  static void add(GstBuffer* frame, float first) {
    const auto flow = numbers(first, gsize{width} * height * 2);
    const auto* meta = gst_buffer_add_event_camera_flow_meta(frame, width, height, flow.get());
    EXPECT_NE(meta, nullptr);
    EXPECT_EQ(gst_event_camera_flow_meta_get_flow(meta), flow.get()) << "not copied";
  }

  static void expect_flow(GstBuffer* frame, float first = 0) {
    const auto* meta = gst_buffer_get_event_camera_flow_meta(frame);
    ASSERT_NE(meta, nullptr);
    EXPECT_EQ(meta->width, width);
    EXPECT_EQ(meta->height, height);
    const auto expected = numbers(first, gsize{width} * height * 2);
    EXPECT_TRUE(g_bytes_equal(gst_event_camera_flow_meta_get_flow(meta), expected.get()));
  }

  /// Pushes a frame with flow through an element.
  static Buffer through(const std::string& line) {
    Harness h(line);
    h.caps("video/x-raw,format=GRAY8,width=4,height=3,framerate=30/1", "video/x-raw");
    EXPECT_EQ(h.push(frame_with_flow().release()), GST_FLOW_OK);
    return h.pull();
  }
};

TEST_F(FlowMeta, IsAddedOnceToAFrame) {
  const Buffer bare(gst_buffer_new());
  EXPECT_EQ(gst_buffer_get_event_camera_flow_meta(bare.get()), nullptr);
  const auto frame = frame_with_flow();
  expect_flow(frame.get());
  add(frame.get(), 100);
  expect_flow(frame.get(), 100);
  EXPECT_EQ(gst_buffer_get_n_meta(frame.get(), GST_EVENT_CAMERA_FLOW_META_API_TYPE), 1U);
}

TEST_F(FlowMeta, StaysWithCopiesOfTheFrame) {
  Buffer frame = frame_with_flow();
  const Buffer copy(gst_buffer_copy(frame.get()));
  const Buffer deep_copy(gst_buffer_copy_deep(frame.get()));
  const Buffer part(gst_buffer_copy_region(frame.get(), GST_BUFFER_COPY_ALL, width, width));
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
  const Buffer frame(gst_buffer_new());
  const float motion[] = {1.5F, -2};
  std::vector<std::byte> bytes(1 + sizeof motion);
  std::memcpy(bytes.data() + 1, motion, sizeof motion);
  const Bytes odd(g_bytes_new_static(bytes.data() + 1, sizeof motion));
  auto* meta = gst_buffer_add_event_camera_flow_meta(frame.get(), 1, 1, odd.get());
  gconstpointer const data = g_bytes_get_data(gst_event_camera_flow_meta_get_flow(meta), nullptr);
  EXPECT_EQ(GPOINTER_TO_SIZE(data) % alignof(float), 0U);
  EXPECT_EQ(std::memcmp(data, motion, sizeof motion), 0);
}

TEST_F(FlowMeta, RefusesOtherSizes) {
  const auto fatal = g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK));
  const Buffer frame(gst_buffer_new());
  const auto add_of = [&](guint of_width, guint of_height, gsize count) {
    return gst_buffer_add_event_camera_flow_meta(frame.get(), of_width, of_height,
                                                 numbers(0, count).get());
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

/* triggers and IMU samples */

TEST_F(Api, TriggersAreCarriedByASerializedEvent) {
  const auto triggers = bytes_of<GstEventCameraTrigger>({{-1, 2, 1}, {3, 4, 0}});
  const Owned<GstEvent> event(gst_event_new_event_camera_triggers(triggers.get()));
  EXPECT_EQ(GST_EVENT_TYPE(event.get()), GST_EVENT_CUSTOM_DOWNSTREAM);  // serialized
  const Bytes read(gst_event_get_event_camera_triggers(event.get()));
  EXPECT_TRUE(g_bytes_equal(read.get(), triggers.get()));
  EXPECT_EQ(gst_event_get_event_camera_imu_samples(event.get()), nullptr);
  const Owned<GstEvent> other(gst_event_new_eos());
  EXPECT_EQ(gst_event_get_event_camera_triggers(other.get()), nullptr);
}

TEST_F(Api, ImuSamplesAreCarriedByASerializedEvent) {
  const auto samples =
      bytes_of<GstEventCameraImuSample>({{7, 20.5F, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}}});
  const Owned<GstEvent> event(gst_event_new_event_camera_imu_samples(samples.get()));
  EXPECT_EQ(GST_EVENT_TYPE(event.get()), GST_EVENT_CUSTOM_DOWNSTREAM);
  const Bytes read(gst_event_get_event_camera_imu_samples(event.get()));
  EXPECT_TRUE(g_bytes_equal(read.get(), samples.get()));
  EXPECT_EQ(gst_event_get_event_camera_triggers(event.get()), nullptr);
}

TEST_F(Api, ReadingSkipsAPartialRecordAndAligns) {
  std::vector<std::byte> memory(1 + 16 + 15);
  memory[1] = std::byte{5};
  const Bytes odd(g_bytes_new_static(memory.data() + 1, 16 + 15));
  const Owned<GstEvent> event(gst_event_new_custom(
      GST_EVENT_CUSTOM_DOWNSTREAM,
      gst_structure_new("GstEventCameraTriggers", "records", G_TYPE_BYTES, odd.get(), nullptr)));
  const Bytes read(gst_event_get_event_camera_triggers(event.get()));
  gsize size = 0;
  const auto* trigger =
      static_cast<const GstEventCameraTrigger*>(g_bytes_get_data(read.get(), &size));
  ASSERT_EQ(size, sizeof *trigger);
  EXPECT_EQ(GPOINTER_TO_SIZE(trigger) % alignof(GstEventCameraTrigger), 0U);
  EXPECT_EQ(trigger->t, 5);
  const Owned<GstEvent> empty(gst_event_new_custom(
      GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty("GstEventCameraTriggers")));
  const Bytes none(gst_event_get_event_camera_triggers(empty.get()));
  EXPECT_EQ(g_bytes_get_size(none.get()), 0U);
}

TEST_F(Api, RefusesPartialRecords) {
  const auto fatal = g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK));
  const auto partial = bytes_of<guint64>({1, 2, 3});
  EXPECT_EQ(gst_event_new_event_camera_triggers(partial.get()), nullptr);
  EXPECT_EQ(gst_event_new_event_camera_imu_samples(partial.get()), nullptr);
  g_log_set_always_fatal(fatal);
}

}  // namespace
