// SPDX-License-Identifier: LGPL-2.1-or-later
/// Labels of the events of a buffer: GstEventCameraLabelMeta.
#include <gst/check/gstharness.h>
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "gst/eventcamera/eventcamera.h"
#include "tests/elements/event_buffer.hpp"

namespace {

using eventcamera::Event;
using eventcamera::Polarity;

class LabelMeta : public testing::Test {
 protected:
  static constexpr gsize count = 5;
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }

  /// Events 0 ... 4, whose labels have their index as class and cause.
  static harness::Buffer labelled_buffer() {
    std::vector<Event> events;
    std::vector<GstEventCameraLabel> labels;
    for (guint8 i = 0; i < count; ++i) {
      events.push_back(Event::at(i, 0, 0, Polarity::on));
      labels.push_back({i, i, 0});
    }
    harness::Buffer buffer(buffer_of(0, events, GST_MSECOND));
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
  const harness::Buffer buffer(buffer_of(0, std::vector<Event>(3), GST_MSECOND));
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(buffer.get()), nullptr);
  gst_buffer_add_event_camera_label_meta(buffer.get(), nullptr, 3);
  expect_labels(buffer.get(), {0, 0, 0});
}

TEST_F(LabelMeta, IsCopiedWithItsBuffer) {
  const auto buffer = labelled_buffer();
  const harness::Buffer copy(gst_buffer_copy(buffer.get()));
  gst_buffer_get_event_camera_label_meta(copy.get())->labels[0].object_class = 77;
  expect_labels(buffer.get(), {0, 1, 2, 3, 4});
  const harness::Buffer deep_copy(gst_buffer_copy_deep(buffer.get()));
  expect_labels(deep_copy.get(), {0, 1, 2, 3, 4});
}

TEST_F(LabelMeta, OfAPartHasTheLabelsOfItsEvents) {
  const auto buffer = labelled_buffer();
  const auto part = [&](gsize offset, gsize size) {
    return harness::Buffer(gst_buffer_copy_region(buffer.get(), GST_BUFFER_COPY_ALL, offset, size));
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
  const harness::Buffer part(gst_buffer_copy_region(buffer.get(), GST_BUFFER_COPY_ALL, 56, 16));
  EXPECT_EQ(gst_buffer_get_event_camera_label_meta(part.get()), nullptr);
}

TEST_F(LabelMeta, IsReadAndWrittenAsBytes) {
  const auto buffer = labelled_buffer();
  GBytes* bytes =
      gst_event_camera_label_meta_get_bytes(gst_buffer_get_event_camera_label_meta(buffer.get()));
  ASSERT_EQ(g_bytes_get_size(bytes), 4 * count);
  const unsigned char expected[] = {3, 0, 3, 0};
  EXPECT_EQ(
      std::memcmp(static_cast<const char*>(g_bytes_get_data(bytes, nullptr)) + 12, expected, 4), 0);
  const harness::Buffer other(gst_buffer_new_allocate(nullptr, 8 * count, nullptr));
  gst_buffer_add_event_camera_label_bytes(other.get(), bytes);
  const auto* added = gst_buffer_get_event_camera_label_meta(other.get());
  ASSERT_NE(added, nullptr);
  EXPECT_EQ(std::memcmp(added->labels, g_bytes_get_data(bytes, nullptr), g_bytes_get_size(bytes)),
            0);
  g_bytes_unref(bytes);
}

}  // namespace
