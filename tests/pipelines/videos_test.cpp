// SPDX-License-Identifier: LGPL-2.1-or-later
// Real video: checks every event of every element on two videos. Skips missing videos.
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <tuple>

#include "gst/eventcamera/eventcamera.h"
#include "tests/pipelines/video_frames.hpp"

namespace {

using video_frames::for_each_sample;

std::string video(const std::string& name) {
  const char* shared = g_getenv("SHARED_DATA");
  return std::string(shared != nullptr ? shared : "") + "/video/" + name;
}

const std::string driving = "driving-1280x720-25fps.mp4";
const std::string cars = "cars-768x432-12fps.mp4";

struct Case {
  std::string element;
  std::string name;
  int intervals;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.element << " on " << c.name;
}

class EveryElement : public testing::TestWithParam<Case> {};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* element :
       {"eventsim-frame", "eventsim-dense", "eventsim-sparse", "eventsim-diff"}) {
    all.push_back({element, driving, 5});
    all.push_back({element, cars, 99});
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(, EveryElement, testing::ValuesIn(cases()));

/// Checks order, bounds, interval and polarity of every event.
TEST_P(EveryElement, MakesSoundEventsOfRealVideo) {
  const auto path = video(GetParam().name);
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  GstClockTime end = 0;
  double events = 0;
  double on = 0;
  double fast = 0;
  int buffers = 0;
  for_each_sample(
      "filesrc location=\"" + path + "\" ! decodebin ! " + GetParam().element +
          " ! application/x-event-camera ! appsink name=sink sync=false max-buffers=4",
      GetParam().intervals, [&](GstSample* sample) {
        GstEventCameraInfo info;
        ASSERT_TRUE(gst_event_camera_info_from_caps(&info, gst_sample_get_caps(sample)));
        GstBuffer* buffer = gst_sample_get_buffer(sample);
        ASSERT_GE(GST_BUFFER_PTS(buffer), end);
        end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
        GstEventCameraMap map;
        ASSERT_TRUE(gst_event_camera_map(&map, buffer));
        for (gsize i = 0; i < map.n_events; ++i) {
          const auto& e = map.events[i];
          ASSERT_LT(e.x, info.width);
          ASSERT_LT(gst_event_camera_event_get_y(&e), static_cast<guint>(info.height));
          ASSERT_LE(e.t, GST_BUFFER_DURATION(buffer) / 1000);
          on += gst_event_camera_event_is_on(&e);
          if (i == 0) continue;
          const auto& last = map.events[i - 1];
          ASSERT_LT(std::tuple(last.t, gst_event_camera_event_get_y(&last), last.x),
                    std::tuple(e.t, gst_event_camera_event_get_y(&e), e.x));
        }
        events += static_cast<double>(map.n_events);
        fast = std::max(fast, static_cast<double>(map.n_events));
        ++buffers;
        gst_event_camera_unmap(&map);
      });
  std::printf("%s on %s: %.0f events an interval, at most %.0f, %.1f %% ON\n",
              GetParam().element.c_str(), GetParam().name.c_str(), events / buffers, fast,
              100 * on / events);
  EXPECT_EQ(buffers, GetParam().intervals);
  EXPECT_GT(on / events, 0.2);
  EXPECT_LT(on / events, 0.8);
}

}  // namespace
