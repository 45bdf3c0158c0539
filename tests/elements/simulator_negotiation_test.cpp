// SPDX-License-Identifier: LGPL-2.1-or-later
// Accepted input, output formats, and the memory of output buffers.
#include <array>
#include <cmath>

#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

const std::string size = ", width=32, height=24, framerate=25/1";

TEST_P(EverySimulator, MakesEventsWhereDownstreamTakesThem) {
  for (const char* downstream : {"ANY", "video/x-raw(ANY); application/x-event-camera"}) {
    Harness h(GetParam());
    h.caps("video/x-raw, format=GRAY8" + size, downstream);
    EXPECT_EQ(h.out_caps(),
              "application/x-event-camera, width=(int)32, height=(int)24, "
              "framerate=(fraction)25/1, format=(string)XYTP");
  }
}

TEST_P(EverySimulator, MakesVideoWhereDownstreamTakesOnlyThat) {
  const bool is_gl = is_on_gpu(GetParam());
  Harness h(GetParam());
  h.caps("video/x-raw, format=I420, pixel-aspect-ratio=4/3, interlace-mode=progressive" + size,
         is_gl ? "video/x-raw(memory:GLMemory)" : "video/x-raw");
  const auto caps = h.out_caps();
  EXPECT_TRUE(contains(caps, is_gl ? "format=(string)RGBA" : "format=(string)BGRx"));
  EXPECT_EQ(caps.find("texture-target=(string)2D") != std::string::npos, is_gl) << caps;
  EXPECT_TRUE(contains(caps, "width=(int)32, height=(int)24"));
  EXPECT_TRUE(contains(caps, "framerate=(fraction)25/1"));
  EXPECT_TRUE(contains(caps, "pixel-aspect-ratio=(fraction)4/3"));
}

TEST(Negotiation, RefusesWhatItCannotRead) {
  Harness h("eventsim-frame");
  gst_harness_set_sink_caps_str(h.get(), "ANY");
  gst_harness_set_src_caps_str(h.get(), ("video/x-raw, format=v210" + size).c_str());
  EXPECT_EQ(h.push(gst_buffer_new_allocate(nullptr, 32 * 24 * 4, nullptr)),
            GST_FLOW_NOT_NEGOTIATED);
}

TEST(Negotiation, AsksUpstreamForTheSizeThatDownstreamWants) {
  Harness h("eventsim-frame");
  gst_harness_set_sink_caps_str(h.get(), "application/x-event-camera, width=640, height=480");
  const Owned<GstCaps> caps(gst_pad_peer_query_caps(h->srcpad, nullptr));
  for (guint i = 0; i < gst_caps_get_size(caps.get()); ++i) {
    int width = 0;
    EXPECT_TRUE(gst_structure_get_int(gst_caps_get_structure(caps.get(), i), "width", &width));
    EXPECT_EQ(width, 640);
  }
}

class EveryInputFormat : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryInputFormat,
                         testing::ValuesIn(video_formats("eventsim-frame", "sink")),
                         [](const auto& test) { return test.param; });

/// A step of 100 grey levels on the left half, of 15 on the right; odd sizes and padded rows.
TEST_P(EveryInputFormat, HasItsLumaReadWhereItLies) {
  for (const int padding : {0, 24}) {
    for (const auto& [width, height] : {std::pair(32, 24), {31, 23}}) {
      Harness h("eventsim-frame");
      h.caps("video/x-raw, format=" + GetParam() + ", framerate=25/1, width=" +
             std::to_string(width) + ", height=" + std::to_string(height));
      const int half = width / 2;
      ASSERT_EQ(h.push(h.frame(
                    0, [](int, int) { return 60; }, padding)),
                GST_FLOW_OK);
      ASSERT_EQ(h.push(h.frame(
                    40 * GST_MSECOND, [&](int x, int) { return x < half ? 160 : 75; }, padding)),
                GST_FLOW_OK);
      const auto buffer = h.pull();
      ASSERT_TRUE(buffer);
      const auto events = events_of(buffer.get());
      EXPECT_EQ(events.size(), static_cast<std::size_t>(half * height));
      for (const auto& event : events) {
        ASSERT_LT(event.x, half);
        ASSERT_TRUE(gst_event_camera_event_is_on(&event));
      }
    }
  }
}

/// The colours of a frame rise, each by so much, from 60. Returns how many pixels fire.
std::size_t fired_by(const std::string& format, const std::string& colorimetry, double threshold,
                     const std::array<int, 3>& rise) {
  Harness h("eventsim-frame positive-threshold=" + std::to_string(threshold));
  h.caps("video/x-raw, framerate=25/1, width=7, height=5, format=" + format +
         (colorimetry.empty() ? "" : ", colorimetry=" + colorimetry));
  h.push(h.flat(0, 60));
  h.push(h.colours(40 * GST_MSECOND, {60 + rise[0], 60 + rise[1], 60 + rise[2]}));
  const auto buffer = h.pull();
  return buffer ? events_of(buffer.get()).size() : 0;
}

/// Input formats whose GstVideoFormatInfo has this flag.
std::vector<std::string> input_formats(GstVideoFormatFlags flag) {
  std::vector<std::string> names;
  for (const auto& name : video_formats("eventsim-frame", "sink"))
    if (const auto* info = gst_video_format_get_info(gst_video_format_from_string(name.c_str()));
        (GST_VIDEO_FORMAT_INFO_FLAGS(info) & flag) != 0)
      names.push_back(name);
  return names;
}

class EveryFormatWithAlpha : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryFormatWithAlpha,
                         testing::ValuesIn(input_formats(GST_VIDEO_FORMAT_FLAG_ALPHA)),
                         [](const auto& test) { return test.param; });

/// A grey of 200 with half alpha is as bright as 100; black of YUV is 16.
TEST_P(EveryFormatWithAlpha, IsCompositedOnBlack) {
  const auto* info = gst_video_format_get_info(gst_video_format_from_string(GetParam().c_str()));
  const double rise = (GST_VIDEO_FORMAT_INFO_IS_YUV(info) ? 200 - 16 : 200) * 128 / 255.0;
  for (const int padding : {0, 24}) {
    for (const auto& [threshold, fired] : {std::pair(rise - 2, 31 * 23U), {rise + 2, 0U}}) {
      Harness h("eventsim-frame positive-threshold=" + std::to_string(threshold));
      h.caps("video/x-raw, framerate=25/1, width=31, height=23, format=" + GetParam());
      GstClockTime time = 0;
      for (const auto& [grey, alpha] : {std::pair(60, 0), {255, 0}, {200, 128}}) {
        ASSERT_FALSE(h.pull()) << "transparent pixels fired";
        h.push(h.frame(
            time, [grey = grey](int, int) { return grey; }, padding, alpha));
        time += 40 * GST_MSECOND;
      }
      const auto buffer = h.pull();
      EXPECT_EQ(buffer ? events_of(buffer.get()).size() : 0, fired) << threshold;
    }
  }
}

class EveryRgbFormat : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryRgbFormat,
                         testing::ValuesIn(input_formats(GST_VIDEO_FORMAT_FLAG_RGB)),
                         [](const auto& test) { return test.param; });

/// Luma changes by 0.2126, 0.7152 and 0.0722 of what red, green and blue do.
TEST_P(EveryRgbFormat, HasEachColourWeighed) {
  const std::array<int, 3> colours[] = {{160, 0, 0}, {0, 160, 0}, {0, 0, 160}};
  const double shares[] = {0.2126, 0.7152, 0.0722};
  for (int colour = 0; colour < 3; ++colour) {
    const double rise = 160 * shares[colour];
    EXPECT_EQ(fired_by(GetParam(), "", rise - 3, colours[colour]), 35U) << colour;
    EXPECT_EQ(fired_by(GetParam(), "", rise + 3, colours[colour]), 0U) << colour;
  }
}

TEST(Negotiation, TakesTheRangeOfLumaFromTheColorimetry) {
  // The first number of a colorimetry is 1 if white is 255, and 2 if it is 235.
  for (const auto& [colorimetry, light] : {std::pair("1:4:7:1", 1), std::pair("2:4:7:1", 4)}) {
    Harness h(
        "eventsim-dvs preset=ideal response=log log-eps=1e-6 overexposed-light=4 "
        "positive-threshold=0.1");
    h.caps("video/x-raw, framerate=25/1, width=7, height=5, format=GRAY8, colorimetry=" +
           std::string(colorimetry));
    h.push(h.flat(0, 60));
    h.push(h.flat(40 * GST_MSECOND, 235));
    EXPECT_EQ(events_of(h.pull().get()).size(),
              35 * static_cast<std::size_t>(std::log(light * 235.0 / 60) / 0.1))
        << colorimetry;
  }
}

TEST(Negotiation, TakesTheWeightsOfColoursFromTheColorimetry) {
  // range 0-255, RGB, sRGB; the last number is that of the primaries
  const std::pair<const char*, double> red_by_primaries[] = {
      {"1:1:7:1", 0.2126}, {"1:1:7:4", 0.299}, {"1:1:7:3", 0.299},
      {"1:1:7:2", 0.30},   {"1:1:7:5", 0.212}, {"1:1:7:7", 0.2627}};
  for (const auto& [colorimetry, share] : red_by_primaries) {
    EXPECT_EQ(fired_by("RGB", colorimetry, 190 * share - 1, {190, 0, 0}), 35U) << colorimetry;
    EXPECT_EQ(fired_by("RGB", colorimetry, 190 * share + 1, {190, 0, 0}), 0U) << colorimetry;
  }
}

class EveryOutputFormat : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryOutputFormat,
                         testing::ValuesIn(video_formats("eventsim-frame", "src")),
                         [](const auto& test) { return test.param; });

/// ON in the left column, OFF in the right one; palette grey looks the same in every format.
TEST_P(EveryOutputFormat, IsDrawn) {
  Harness h("eventsim-frame palette=grey");
  h.caps("video/x-raw, format=GRAY8, width=5, height=3, framerate=25/1",
         "video/x-raw, format=" + GetParam());
  h.push(h.flat(0, 100));
  h.pull();  // empty
  h.push(h.frame(40 * GST_MSECOND, [](int x, int) { return x == 0 ? 200 : x == 4 ? 0 : 100; }));
  const auto buffer = h.pull();
  ASSERT_TRUE(buffer);
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
  GstVideoInfo info;
  ASSERT_TRUE(gst_video_info_from_caps(&info, caps.get()));
  EXPECT_EQ(gst_buffer_get_size(buffer.get()), GST_VIDEO_INFO_SIZE(&info));
  GstVideoFrame frame;
  ASSERT_TRUE(gst_video_frame_map(&frame, &info, buffer.get(), GST_MAP_READ));
  const int expected[] = {255, 128, 128, 128, 0};
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      for (guint c = 0; c < GST_VIDEO_INFO_N_COMPONENTS(&info); ++c) {
        const auto* byte = static_cast<guint8*>(GST_VIDEO_FRAME_COMP_DATA(&frame, c)) +
                           y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) +
                           x * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c);
        EXPECT_EQ(*byte, c == GST_VIDEO_COMP_A ? 255 : expected[x]) << x << "," << y;
      }
    }
  }
  gst_video_frame_unmap(&frame);
}

TEST(Allocation, TellsUpstreamThatAnyStrideIsWelcome) {
  Harness h("eventsim-frame");
  h.caps("video/x-raw, format=GRAY8" + size);
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->srcpad));
  GstQuery* query = gst_query_new_allocation(caps.get(), TRUE);
  EXPECT_TRUE(gst_pad_peer_query(h->srcpad, query));
  EXPECT_TRUE(gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr));
  gst_query_unref(query);
}

}  // namespace
