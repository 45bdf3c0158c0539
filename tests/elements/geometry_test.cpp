// SPDX-License-Identifier: LGPL-2.1-or-later
// Elements that move events: sizes in caps, negotiation, and files.
#include <png.h>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Event;

constexpr GstClockTime ms = GST_MSECOND;
const std::string sensor = "application/x-event-camera, format=XYTP, width=8, height=4";

using Pixels = std::vector<std::pair<int, int>>;

Pixels pixels_of(const Buffer& buffer) {
  Pixels pixels;
  if (buffer)
    for (const auto& event : events_of(buffer.get()))
      pixels.emplace_back(event.x, gst_event_camera_event_get_y(&event));
  return pixels;
}

/// Pushes events of 1 ms at the next millisecond, and returns where they come out.
Pixels passed(Harness& h, const std::vector<Event>& events) {
  static GstClockTime pts = 0;
  EXPECT_EQ(h.push(buffer_of(pts += ms, events, ms)), GST_FLOW_OK);
  return pixels_of(h.pull());
}

/// Caps that the element asks upstream for, if downstream wants these.
std::string wanted(const std::string& launch, const std::string& downstream) {
  Harness h(launch);
  gst_harness_set_sink_caps_str(h.get(), ("application/x-event-camera, " + downstream).c_str());
  return text_of(Owned<GstCaps>(gst_caps_simplify(gst_pad_peer_query_caps(h->srcpad, nullptr))));
}

TEST(Crop, ChangesTheSize) {
  Harness h("eventcrop left=1 right=2 top=1 bottom=1");
  h.caps(sensor);
  EXPECT_EQ(passed(h, {on(0, 1), on(1, 1), on(5, 2), on(6, 2), on(5, 3)}),
            (Pixels{{0, 0}, {4, 1}}));
  EXPECT_EQ(size_of(h.get()), "5x2");
  EXPECT_EQ(stat_of(h.element(), "dropped-events"), 3U);
}

TEST(Crop, AsksUpstreamForTheSizeThatDownstreamWants) {
  const auto caps = wanted("eventcrop left=100 bottom=7", "width=20, height=30");
  EXPECT_TRUE(contains(caps, "width=(int)120, height=(int)37"));
  const auto ranges = wanted("eventcrop left=100 bottom=7", "width=[10,20], height=[1,16384]");
  EXPECT_TRUE(contains(ranges, "width=(int)[ 110, 120 ], height=(int)[ 8, 16384 ]"));
}

TEST(Crop, FollowsChanges) {
  Harness h("eventcrop left=4");
  h.caps(sensor);
  EXPECT_EQ(passed(h, {on(4, 1)}), (Pixels{{0, 1}}));
  g_object_set(h.element(), "left", 1U, "top", 1U, nullptr);
  EXPECT_EQ(passed(h, {on(4, 1)}), (Pixels{{3, 0}}));
  EXPECT_EQ(size_of(h.get()), "7x3");
  h.caps("application/x-event-camera, format=XYTP, width=20, height=20");
  EXPECT_EQ(passed(h, {on(19, 19)}), (Pixels{{18, 18}}));
  EXPECT_EQ(size_of(h.get()), "19x19");
}

TEST(Flip, HasTheDirectionsOfVideoflip) {
  // Where the pixel (1, 0) of 8x4 goes.
  const std::tuple<const char*, std::pair<int, int>, const char*> directions[] = {
      {"identity", {1, 0}, "8x4"}, {"90r", {3, 1}, "4x8"},   {"180", {6, 3}, "8x4"},
      {"90l", {0, 6}, "4x8"},      {"horiz", {6, 0}, "8x4"}, {"vert", {1, 3}, "8x4"},
      {"ul-lr", {0, 1}, "4x8"},    {"ur-ll", {3, 6}, "4x8"}};
  for (const auto& [direction, pixel, size] : directions) {
    Harness h(std::string("eventflip video-direction=") + direction);
    h.caps(sensor);
    EXPECT_EQ(passed(h, {on(1, 0)}), Pixels{pixel}) << direction;
    EXPECT_EQ(size_of(h.get()), size) << direction;
    EXPECT_TRUE(GST_IS_VIDEO_DIRECTION(h.element()));
  }
}

/// A direction that is set after the caps were negotiated, here with each CAPS event, is that of
/// the next buffer.
TEST(Flip, KeepsTheEventsOfTheBufferAtAChange) {
  Harness h("eventflip video-direction=90r");
  const auto src = static_pad(h.element(), "src");
  const auto change = +[](GstPad*, GstPadProbeInfo* info, gpointer element) {
    if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) != GST_EVENT_CAPS) return GST_PAD_PROBE_OK;
    int direction = 0;
    g_object_get(element, "video-direction", &direction, nullptr);
    const bool is_identity = direction == GST_VIDEO_ORIENTATION_IDENTITY;
    g_object_set(element, "video-direction",
                 is_identity ? GST_VIDEO_ORIENTATION_90R : GST_VIDEO_ORIENTATION_IDENTITY, nullptr);
    return GST_PAD_PROBE_OK;
  };
  const gulong probe = gst_pad_add_probe(src.get(), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, change,
                                         h.element(), nullptr);
  h.caps(sensor);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(passed(h, {on(1, 0)}).size(), 1U);
  gst_pad_remove_probe(src.get(), probe);
  gst_util_set_object_arg(G_OBJECT(h.element()), "video-direction", "identity");
  EXPECT_EQ(passed(h, {on(1, 0)}), (Pixels{{1, 0}}));
  EXPECT_EQ(stat_of(h.element(), "dropped-events"), 0U);
}

TEST(Scale, HasTheSizeOfTheCapsDownstream) {
  Harness h("eventscale");
  h.caps(sensor, "application/x-event-camera, width=4, height=2");
  EXPECT_EQ(passed(h, {on(0, 0), on(1, 1), on(2, 3), on(3, 2, 1), on(3, 2, 1)}),
            (Pixels{{0, 0}, {1, 1}, {1, 1}}));
  EXPECT_EQ(size_of(h.get()), "4x2");
}

TEST(Scale, KeepsTheShapeWhereOneSideIsFree) {
  const std::pair<const char*, const char*> sizes[] = {
      {"width=4", "4x2"},      {"height=8", "16x8"},      {"width=[1,6], height=[1,3]", "6x3"},
      {"width=[1,4]", "4x2"},  {"height=[1,2]", "4x2"},   {"width={4,2}", "4x2"},
      {"height={1,2}", "4x2"}, {"width=[1,16384]", "8x4"}};
  for (const auto& [downstream, size] : sizes) {
    Harness h("eventscale");
    h.caps(sensor, std::string("application/x-event-camera, ") + downstream);
    passed(h, {on(0, 0)});
    EXPECT_EQ(size_of(h.get()), size) << downstream;
  }
}

TEST(Scale, TakesEverySizeUpstream) {
  const auto caps = wanted("eventscale", "width=20, height=30");
  EXPECT_TRUE(contains(caps, "width=(int)[ 1, 16384 ], height=(int)[ 1, 16384 ]"));
}

/// A file of the name of the test.
class FileTest : public testing::Test {
 protected:
  std::string location() const { return " location=" + in_quotes(file.path()); }
  void write(const std::string& text) const {
    std::ofstream(file.path(), std::ios::binary) << text;
  }
  void write_mask(int width, int height, const std::vector<png_byte>& grey) const {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = PNG_FORMAT_GRAY;
    png_image_write_to_file(&image, file.path().c_str(), 0, grey.data(), 0, nullptr);
  }

  /// The error of an element that cannot use the file.
  static std::string error_of(const std::string& launch) {
    Harness h(launch);
    h.caps(sensor);
    EXPECT_NE(h.push(buffer_of(0, {on(1, 1)}, ms)), GST_FLOW_OK);
    return h.error();
  }

  TemporaryFile file;
};

TEST_F(FileTest, MasksPixels) {
  std::vector<png_byte> grey(32, 255);
  grey[8 + 2] = 0;
  write_mask(8, 4, grey);
  Harness h("eventmask" + location());
  h.caps(sensor);
  EXPECT_EQ(passed(h, {on(1, 1), on(2, 1), on(3, 1)}), (Pixels{{1, 1}, {3, 1}}));
}

TEST_F(FileTest, MaskThatDoesNotFitIsAnError) {
  write_mask(4, 8, std::vector<png_byte>(32, 255));
  const auto error = error_of("eventmask" + location());
  EXPECT_TRUE(contains(error, "4 x 8 pixels, but the sensor has 8 x 4"));
  EXPECT_TRUE(contains(error, file.path()));
}

/// Focal length 10, principal point (4, 2).
std::string calibration(const std::string& k1, const std::string& more = "") {
  return "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   "
         "data: "
         "[ 10., 0., 4., 0., 10., 2., 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   "
         "rows: 5\n   cols: 1\n   dt: d\n   data: [ " +
         k1 + ", 0., 0., 0., 0. ]\n" + more;
}

TEST_F(FileTest, UndistortsAndCounts) {
  write(calibration("-2."));
  Harness h("eventundistort" + location());
  h.caps(sensor);
  // 0.2 = r (1 - 2 r^2) at r = 0.2279 and 0.4 at none: pixels 2 and 4 from the centre.
  EXPECT_EQ(passed(h, {on(4, 2), on(6, 2), on(0, 2)}), (Pixels{{4, 2}, {6, 2}}));
  EXPECT_EQ(stat_of(h.element(), "dropped-events"), 1U);
}

TEST_F(FileTest, CalibrationMayBeText) {
  Harness h("eventundistort location=/nowhere/at/all.yaml");
  g_object_set(h.element(), "settings", calibration("-2.").c_str(), nullptr);
  h.caps(sensor);
  EXPECT_EQ(passed(h, {on(4, 2), on(6, 2), on(0, 2)}), (Pixels{{4, 2}, {6, 2}}));
  EXPECT_TRUE(contains(error_of("eventundistort settings=\"camera: [\""), "\"settings\": line"));
}

TEST_F(FileTest, CalibrationThatDoesNotFitIsAnError) {
  write(calibration("0.", "image_width: 346\nimage_height: 260\n"));
  const auto error = error_of("eventundistort" + location());
  EXPECT_TRUE(contains(error, "346 x 260 pixels, but the sensor has 8 x 4"));
  write("camera: [");
  EXPECT_TRUE(contains(error_of("eventundistort" + location()), "line"));
}

}  // namespace
