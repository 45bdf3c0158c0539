// SPDX-License-Identifier: LGPL-2.1-or-later
// Origin and memory of the buffers of intervals.
#include <new>
#include <set>
#include <tuple>

#include "gst/base/buffer_bytes.hpp"
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

/// An element, and whether it draws.
class EveryOutput : public testing::TestWithParam<std::tuple<const char*, bool>> {};
INSTANTIATE_TEST_SUITE_P(, EveryOutput,
                         testing::Combine(testing::ValuesIn(simulators), testing::Bool()));

TEST_P(EveryOutput, ComesFromAPool) {
  const auto& [element, draws] = GetParam();
  Harness h(element);
  h.caps("video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1",
         draws ? pictures_of(element) : GST_EVENT_CAMERA_MEDIA_TYPE);
  std::set<GstBuffer*> buffers;
  for (int i = 0; i < 10; ++i) {
    h.push(h.flat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, i % 2 == 0 ? 50 : 200));
    const auto buffer = h.pull();
    ASSERT_EQ(buffer != nullptr, draws || i > 0);
    if (!buffer) continue;
    EXPECT_NE(buffer->pool, nullptr);
    buffers.insert(buffer.get());
  }
  EXPECT_LE(buffers.size(), 2U);
}

/// Frames in which a given number of rows changes.
class Rows {
 public:
  explicit Rows(Harness& h) : h_(h) {}

  /// Pushes a frame and returns the output.
  Buffer change(gsize rows) {
    for (gsize y = 0; y < rows; ++y) bright_[y] = !bright_[y];
    GstBuffer* const frame = gst_buffer_new_allocate(nullptr, size * size, nullptr);
    for (gsize y = 0; y < size; ++y)
      gst_buffer_memset(frame, y * size, bright_[y] ? 200 : 50, size);
    GST_BUFFER_PTS(frame) = 40 * GST_MSECOND * count_++;
    EXPECT_EQ(h_.push(frame), GST_FLOW_OK);
    return h_.pull();
  }

 private:
  static constexpr gsize size = 1000;

  Harness& h_;
  bool bright_[size] = {};
  GstClockTime count_ = 0;
};

gsize room_of(const Buffer& buffer) {
  gsize room = 0;
  gst_buffer_get_sizes(buffer.get(), nullptr, &room);
  return room;
}

constexpr const char* large_video =
    "video/x-raw, format=GRAY8, width=1000, height=1000, framerate=25/1";

/// A buffer that returns to its pool must not be mapped.
TEST(WritableBytes, AreUnmappedByAnException) {
  gst_init(nullptr, nullptr);
  const Buffer buffer(gst_buffer_new_allocate(nullptr, 16, nullptr));
  // Unlike gst_buffer_map(), this does not map a copy instead.
  const auto can_be_read = [memory = gst_buffer_peek_memory(buffer.get(), 0)] {
    GstMapInfo map;
    if (!gst_memory_map(memory, &map, GST_MAP_READ)) return false;
    gst_memory_unmap(memory, &map);
    return true;
  };
  try {
    const WritableBytes mapped(buffer.get());
    EXPECT_EQ(mapped.events().size(), 2U);
    EXPECT_FALSE(can_be_read());
    throw std::bad_alloc();
  } catch (const std::bad_alloc&) {
    EXPECT_TRUE(can_be_read());
  }
}

TEST(EventBuffers, AreAsLongAsTheirEvents) {
  Harness h("eventsim-frame");
  h.caps(large_video);
  Rows rows(h);
  EXPECT_FALSE(rows.change(0));
  for (const gsize count : {1, 3, 1000, 2, 999, 1}) {
    const auto buffer = rows.change(count);
    ASSERT_TRUE(buffer);
    const auto events = events_of(buffer.get());
    ASSERT_EQ(events.size(), count * 1000);
    for (std::size_t i = 0; i < events.size(); ++i) {
      ASSERT_EQ(events[i].x, i % 1000);
      ASSERT_EQ(gst_event_camera_event_get_y(&events[i]), i / 1000);
    }
  }
}

TEST(EventBuffers, GiveBackTheMemoryOfOneExtremeFrame) {
  Harness h("eventsim-frame");
  h.caps(large_video);
  Rows rows(h);
  rows.change(0);
  EXPECT_GE(room_of(rows.change(1000)), 8'000'000U);
  EXPECT_GE(room_of(rows.change(1)), 8'000'000U);  // it may be needed again
  gsize room = 0;
  for (int i = 0; i < 300; ++i) room = room_of(rows.change(1));
  EXPECT_LE(room, 300'000U);
}

TEST(EventBuffers, AreNotKeptWithoutBound) {
  Harness h("eventsim-frame");
  h.caps(large_video);
  Rows rows(h);
  rows.change(0);
  const GQuark seen = g_quark_from_static_string("seen by the test");
  std::vector<Buffer> held;
  for (int i = 0; i < 30; ++i) {
    held.push_back(rows.change(1000));
    gst_mini_object_set_qdata(GST_MINI_OBJECT(held.back().get()), seen, &held, nullptr);
  }
  held.clear();
  int kept = 0;
  for (int i = 0; i < 30; ++i) {
    held.push_back(rows.change(1000));
    kept += gst_mini_object_get_qdata(GST_MINI_OBJECT(held.back().get()), seen) != nullptr;
  }
  EXPECT_GE(kept, 2);
  EXPECT_LE(kept, 8);
}

}  // namespace
