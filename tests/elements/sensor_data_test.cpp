// SPDX-License-Identifier: LGPL-2.1-or-later
/// Triggers and IMU samples in the C API.
#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "tests/elements/harness.hpp"

namespace {

using harness::Owned;

struct UnrefBytes {
  void operator()(GBytes* bytes) const { g_bytes_unref(bytes); }
};
using Bytes = std::unique_ptr<GBytes, UnrefBytes>;

template <class Record>
Bytes bytes_of(const std::vector<Record>& records) {
  return Bytes(g_bytes_new(records.data(), records.size() * sizeof(Record)));
}

class SensorData : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }
};

TEST_F(SensorData, TriggersAreCarriedByASerializedEvent) {
  const auto triggers = bytes_of<GstEventCameraTrigger>({{-1, 2, 1}, {3, 4, 0}});
  const Owned<GstEvent> event(gst_event_new_event_camera_triggers(triggers.get()));
  EXPECT_EQ(GST_EVENT_TYPE(event.get()), GST_EVENT_CUSTOM_DOWNSTREAM);  // serialized
  const Bytes read(gst_event_get_event_camera_triggers(event.get()));
  EXPECT_TRUE(g_bytes_equal(read.get(), triggers.get()));
  EXPECT_EQ(gst_event_get_event_camera_imu_samples(event.get()), nullptr);
  const Owned<GstEvent> other(gst_event_new_eos());
  EXPECT_EQ(gst_event_get_event_camera_triggers(other.get()), nullptr);
}

TEST_F(SensorData, ImuSamplesAreCarriedByASerializedEvent) {
  const auto samples =
      bytes_of<GstEventCameraImuSample>({{7, 20.5F, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}}});
  const Owned<GstEvent> event(gst_event_new_event_camera_imu_samples(samples.get()));
  EXPECT_EQ(GST_EVENT_TYPE(event.get()), GST_EVENT_CUSTOM_DOWNSTREAM);
  const Bytes read(gst_event_get_event_camera_imu_samples(event.get()));
  EXPECT_TRUE(g_bytes_equal(read.get(), samples.get()));
  EXPECT_EQ(gst_event_get_event_camera_triggers(event.get()), nullptr);
}

TEST_F(SensorData, ReadingSkipsAPartialRecordAndAligns) {
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

TEST_F(SensorData, RefusesPartialRecords) {
  const auto fatal = g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK));
  const auto partial = bytes_of<guint64>({1, 2, 3});
  EXPECT_EQ(gst_event_new_event_camera_triggers(partial.get()), nullptr);
  EXPECT_EQ(gst_event_new_event_camera_imu_samples(partial.get()), nullptr);
  g_log_set_always_fatal(fatal);
}

}  // namespace
