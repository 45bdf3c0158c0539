// SPDX-License-Identifier: LGPL-2.1-or-later
// Behaviour under stream changes, and the memory of output buffers.
#include <new>
#include <set>
#include <tuple>

#include "gst/base/buffer_bytes.hpp"
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

std::string video(int width, int height, const char* format = "GRAY8", int fps = 25) {
  return std::string("video/x-raw, format=") + format + ", width=" + std::to_string(width) +
         ", height=" + std::to_string(height) + ", framerate=" + std::to_string(fps) + "/1";
}

/// True for elements with per-pixel thresholds and individual event times.
bool is_physical(const std::string& element) {
  return element.ends_with("eventsim-dvs");
}

INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

TEST_P(EverySimulator, BeginsAnewWhenTheSizeChanges) {
  Harness h(GetParam());
  h.caps(video(61, 43));
  h.push(h.flat(80 * GST_MSECOND, 10));
  h.push(h.flat(120 * GST_MSECOND, 210));
  EXPECT_TRUE(h.pull());
  h.caps(video(33, 29));
  h.push(h.flat(160 * GST_MSECOND, 10));
  EXPECT_FALSE(h.pull());
  h.push(h.flat(200 * GST_MSECOND, 210));
  const auto buffer = h.pull();
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), 160 * GST_MSECOND);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(buffer.get()));
  const auto events = events_of(buffer.get());
  // A pixel with a reference level fires at each threshold it passes.
  const std::size_t each = is_physical(GetParam()) ? 8 : 1;
  EXPECT_EQ(events.size(), each * 33U * 29U);
  EXPECT_TRUE(contains(h.out_caps(), "width=(int)33"));
}

TEST_P(EverySimulator, LosesNoIntervalWhenOnlyTheFormatOrTheFramerateChanges) {
  Harness h(GetParam());
  h.caps(video(32, 24, "GRAY8"));
  h.push(h.flat(0, 50));
  h.caps(video(32, 24, "NV12", 30));
  h.push(h.flat(40 * GST_MSECOND, 200));
  EXPECT_TRUE(h.pull());
  h.caps(video(32, 24, "YUY2", 30));
  h.push(h.flat(80 * GST_MSECOND, 50));
  EXPECT_TRUE(h.pull());
}

TEST_P(EverySimulator, SwitchesFromEventsToVideoWithoutLosingAnInterval) {
  Harness h(GetParam());
  h.caps(video(32, 24));
  h.push(h.flat(0, 50));
  h.push(h.flat(40 * GST_MSECOND, 200));
  const auto last = events_of(h.pull().get()).back();
  if (is_physical(GetParam()))
    EXPECT_GT(last.t, 30'000U);
  else
    EXPECT_EQ(last.t, 40'000U);
  gst_harness_set_sink_caps_str(h.get(), pictures_of(GetParam()).c_str());
  gst_harness_push_upstream_event(h.get(), gst_event_new_reconfigure());
  h.push(h.flat(80 * GST_MSECOND, 50));
  const auto picture = h.pull();
  ASSERT_TRUE(picture);
  EXPECT_EQ(GST_BUFFER_PTS(picture.get()), 80 * GST_MSECOND);  // that of its frame
  EXPECT_EQ(gst_buffer_get_size(picture.get()), 32U * 24U * 4U);
}

/// A frame with an invalid meta.
GstFlowReturn push_with_meta(const char* format, int stride, gsize offset, gsize size) {
  Harness h("eventsim-frame");
  h.caps(video(320, 240, format));
  GstBuffer* buffer = filled(size, 100, 0, GST_CLOCK_TIME_NONE);
  add_video_meta(buffer, gst_video_format_from_string(format), 320, 240, {{offset, stride}});
  const GstFlowReturn flow = h.push(buffer);
  EXPECT_EQ(flow != GST_FLOW_OK, h.message(GST_MESSAGE_ERROR) != nullptr);
  return flow;
}

TEST(Stream, RefusesMetasThatLie) {
  EXPECT_EQ(push_with_meta("GRAY8", 320, 0, 76800), GST_FLOW_OK);
  EXPECT_EQ(push_with_meta("GRAY8", 400, 80, 96000), GST_FLOW_OK);
  EXPECT_EQ(push_with_meta("GRAY8", 4096, 0, 76800), GST_FLOW_ERROR);  // past the end of the buffer
  EXPECT_EQ(push_with_meta("GRAY8", 320, 80, 76800), GST_FLOW_ERROR);
  EXPECT_EQ(push_with_meta("GRAY8", 319, 0, 76800), GST_FLOW_ERROR);  // rows that overlap
  EXPECT_EQ(push_with_meta("GRAY8", 0, 0, 400), GST_FLOW_ERROR);
  EXPECT_EQ(push_with_meta("GRAY8", -320, 76480, 76800), GST_FLOW_ERROR);
  EXPECT_EQ(push_with_meta("GRAY16_LE", 643, 0, 200000), GST_FLOW_ERROR);  // unaligned words
  EXPECT_EQ(push_with_meta("GRAY16_LE", 642, 1, 200000), GST_FLOW_ERROR);
}

TEST(Stream, RefusesFramesSmallerThanTheirCaps) {
  struct Meta {
    GstVideoFormat format;
    int width;
    std::vector<Plane> planes;
    const char* error;
  };
  const std::vector<Plane> one_plane{{0, 62}};
  const std::vector<Plane> two_planes{{0, 62}, {gsize{62} * 44, 62}};
  for (const auto& meta : {Meta{GST_VIDEO_FORMAT_NV12, 60, two_planes, "NV12 of 60x44 pixels"},
                           Meta{GST_VIDEO_FORMAT_GRAY8, 62, one_plane, "GRAY8 of 62x44 pixels"},
                           Meta{GST_VIDEO_FORMAT_NV12, 62, one_plane, "NV12 of 62x44 pixels"}}) {
    Harness h("eventsim-frame");
    h.caps(video(62, 44, "NV12"));
    GstBuffer* buffer = h.flat(0, 100);
    add_video_meta(buffer, meta.format, meta.width, 44, meta.planes);
    EXPECT_EQ(h.push(buffer), GST_FLOW_ERROR);
    EXPECT_TRUE(contains(h.error(), meta.error));
  }
}

/// A meta of these tags, as elements that this project does not know make them.
void add_custom_meta(GstBuffer* frame, const char* name, std::vector<const gchar*> tags) {
  tags.push_back(nullptr);
  if (gst_meta_get_info(name) == nullptr)
    gst_meta_register_custom(name, tags.data(), nullptr, nullptr, nullptr);
  gst_buffer_add_custom_meta(frame, name);
}

TEST(Stream, GivesPicturesWhatStaysTrueOfTheirFrame) {
  Harness h("eventsim-frame");
  h.caps(video(32, 24), "video/x-raw, format=BGRx");
  GstBuffer* frame = h.frame(
      0, [](int, int) { return 90; }, 8);  // padded rows, by a GstVideoMeta
  GstVideoCropMeta* crop = gst_buffer_add_video_crop_meta(frame);
  crop->x = 3;
  crop->height = 10;
  gst_buffer_add_video_region_of_interest_meta(frame, "face", 1, 2, 5, 6);
  add_custom_meta(frame, "EventSimTestPlace", {GST_META_TAG_VIDEO_STR});
  add_custom_meta(frame, "EventSimTestUntagged", {});
  add_custom_meta(frame, "EventSimTestColours",
                  {GST_META_TAG_VIDEO_STR, GST_META_TAG_VIDEO_COLORSPACE_STR});
  add_custom_meta(frame, "EventSimTestMemory", {GST_META_TAG_MEMORY_STR});
  h.push(frame);
  const auto picture = h.pull();
  ASSERT_TRUE(picture);
  const auto* kept = gst_buffer_get_video_crop_meta(picture.get());
  ASSERT_NE(kept, nullptr);
  EXPECT_EQ(kept->x, 3U);
  EXPECT_EQ(kept->height, 10U);
  EXPECT_NE(gst_buffer_get_video_region_of_interest_meta_id(picture.get(), 0), nullptr);
  EXPECT_NE(gst_buffer_get_custom_meta(picture.get(), "EventSimTestPlace"), nullptr);
  EXPECT_NE(gst_buffer_get_custom_meta(picture.get(), "EventSimTestUntagged"), nullptr);
  EXPECT_EQ(gst_buffer_get_custom_meta(picture.get(), "EventSimTestColours"), nullptr);
  EXPECT_EQ(gst_buffer_get_custom_meta(picture.get(), "EventSimTestMemory"), nullptr);
  if (const auto* layout = gst_buffer_get_video_meta(picture.get())) {
    EXPECT_EQ(layout->format, GST_VIDEO_FORMAT_BGRx);  // its own
  }
}

TEST(Stream, GivesEventsNothingOfTheFrameThatEndsThem) {
  Harness h("eventsim-frame");
  h.caps(video(32, 24));
  h.push(h.flat(0, 50));
  GstBuffer* frame = h.flat(40 * GST_MSECOND, 200);
  GST_BUFFER_OFFSET(frame) = 77;
  GST_BUFFER_FLAG_SET(frame, GST_BUFFER_FLAG_CORRUPTED | GST_BUFFER_FLAG_MARKER);
  GstCaps* clock = gst_caps_new_empty_simple("timestamp/x-test");
  gst_buffer_add_reference_timestamp_meta(frame, clock, 40 * GST_MSECOND, 0);
  gst_caps_unref(clock);
  h.push(frame);
  const auto picture = h.pull();
  ASSERT_TRUE(picture);
  EXPECT_FALSE(GST_BUFFER_OFFSET_IS_VALID(picture.get()));
  EXPECT_FALSE(
      GST_BUFFER_FLAG_IS_SET(picture.get(), GST_BUFFER_FLAG_CORRUPTED | GST_BUFFER_FLAG_MARKER));
  EXPECT_EQ(gst_buffer_get_reference_timestamp_meta(picture.get(), nullptr), nullptr);
}

TEST(Stream, WarnsOnceOfInterlacedVideo) {
  Harness h("eventsim-frame");
  h.caps(video(61, 43, "I420") + ", interlace-mode=interleaved");
  h.push(h.flat(0, 50));
  h.push(h.flat(40 * GST_MSECOND, 50));
  EXPECT_TRUE(contains(h.warning(), "deinterlace"));
  EXPECT_EQ(h.warning(), "");
}

void push_orientation(Harness& h, const char* orientation) {
  gst_harness_push_event(h.get(), gst_event_new_tag(gst_tag_list_new(GST_TAG_IMAGE_ORIENTATION,
                                                                     orientation, nullptr)));
}

TEST(Stream, WarnsOnceOfRotatedVideo) {
  Harness h("eventsim-frame");
  h.caps(video(61, 43));
  push_orientation(h, "rotate-0");
  EXPECT_EQ(h.warning(), "");
  push_orientation(h, "rotate-90");
  push_orientation(h, "rotate-180");
  EXPECT_TRUE(contains(h.warning(), "videoflip video-direction=auto"));
  EXPECT_EQ(h.warning(), "");
}

TEST(Stream, WarnsOfAFileWithoutTheTimesOfBuffers) {
  for (const std::string writer : {"", "evtenc ! "}) {
    Harness h("eventsim-frame ! " + writer + "filesink location=/dev/null async=false");
    gst_harness_set_src_caps_str(h.get(), video(61, 43).c_str());
    h.wait_for_events();
    EXPECT_EQ(h.warning().find("eventnpzenc") != std::string::npos, writer.empty());
  }
}

/* buffers */

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
