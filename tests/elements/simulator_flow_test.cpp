// SPDX-License-Identifier: LGPL-2.1-or-later
// Simulators and the optical flow of frames, in and out.
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/difference.hpp"
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;
using eventcamera::Flow;
using eventcamera::FlowMethod;
using eventcamera::Image;

constexpr int width = 96;
constexpr int height = 64;
constexpr int frame_count = 5;
constexpr GstClockTime interval = 40 * GST_MSECOND;
constexpr const char* video = "video/x-raw, format=GRAY8, width=96, height=64, framerate=25/1";

/// Frame of a pattern that moves by (3, 1) pixels per interval.
Image<std::uint8_t> image_of(int i) {
  Image<std::uint8_t> image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at(x, y) = static_cast<std::uint8_t>(120 + 100 * std::sin((x - 3 * i) * 0.35) *
                                                           std::cos((y - i) * 0.27));
  return image;
}

template <class Pixel>
std::string bytes_of(const Image<Pixel>& image) {
  std::string bytes;
  for (int y = 0; y < height; ++y)
    bytes.append(reinterpret_cast<const char*>(image.row(y)), width * sizeof(Pixel));
  return bytes;
}

GstBuffer* frame_of(int i, const std::optional<Image<Flow>>& flow = {}) {
  const auto bytes = bytes_of(image_of(i));
  GstBuffer* buffer = gst_buffer_new_memdup(bytes.data(), bytes.size());
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(i) * interval;
  if (!flow) return buffer;
  const auto rows = bytes_of(*flow);
  GBytes* const flow_bytes = g_bytes_new(rows.data(), rows.size());
  gst_buffer_add_event_camera_flow_meta(buffer, width, height, flow_bytes);
  g_bytes_unref(flow_bytes);
  return buffer;
}

/// Bytes of the flow that a buffer has; empty if none.
std::string flow_of(GstBuffer* buffer) {
  const auto* meta = gst_buffer_get_event_camera_flow_meta(buffer);
  if (meta == nullptr) return "";
  EXPECT_EQ(meta->width, 96U);
  EXPECT_EQ(meta->height, 64U);
  gsize size = 0;
  const auto* data = g_bytes_get_data(gst_event_camera_flow_meta_get_flow(meta), &size);
  return {static_cast<const char*>(data), size};
}

/// A simulator, its threshold in grey levels, and how it finds flow.
struct Simulator {
  const char* launch;
  int threshold;
  FlowMethod method;
};

class EveryFlowSimulator : public testing::TestWithParam<Simulator> {
 protected:
  /// The flow that the simulator finds from frame i to the next one.
  Image<Flow> own_flow(int i) {
    const auto last = image_of(i);
    const auto now = image_of(i + 1);
    const auto changed = eventcamera::changed_box(last.view(), now.view(), GetParam().threshold);
    Image<Flow> flow(width, height);
    flow.assign(finder.find(last.view(), now.view(), changed, threads));
    return flow;
  }

  /// Bytes of the events, where each frame has the flow that `flow_from` gives.
  static std::string events_with(const std::function<std::optional<Image<Flow>>(int)>& flow_from) {
    Harness h = without_upload(GetParam().launch);  // glupload drops flow
    h.caps(video);
    for (int i = 0; i < frame_count; ++i) EXPECT_EQ(h.push(frame_of(i, flow_from(i))), GST_FLOW_OK);
    std::string bytes;
    while (const auto buffer = h.pull()) bytes += harness::bytes_of(buffer.get());
    return bytes;
  }

  /// Bytes of the events, where no frame has a flow.
  static std::string own_events() {
    return events_with([](int) { return std::nullopt; });
  }

  eventcamera::ThreadPool threads;
  eventcamera::RegionOfInterestFlow finder{GetParam().method, width, height};
};
INSTANTIATE_TEST_SUITE_P(
    , EveryFlowSimulator,
    testing::Values(Simulator{"eventsim-dense", 2, FlowMethod::dis_lq},
                    Simulator{"eventsim-dense interpolation=blend", 2, FlowMethod::dis_lq},
                    Simulator{"eventsim-dvs preset=ideal upsampling=motion", 0, FlowMethod::dis_mq},
                    Simulator{"gleventsim-dvs preset=ideal upsampling=motion", 0,
                              FlowMethod::dis_mq}));

TEST_P(EveryFlowSimulator, UsesTheFlowOfItsFrames) {
  const auto expected = own_events();
  ASSERT_GT(expected.size(), 8000U);
  EXPECT_TRUE(events_with([&](int i) { return own_flow(i); }) == expected);
  EXPECT_FALSE(events_with([](int) { return Image<Flow>(width, height); }) == expected);
}

TEST_P(EveryFlowSimulator, FindsTheFlowOfFramesWithoutIt) {
  const auto flow_of_every_second = [&](int i) -> std::optional<Image<Flow>> {
    auto flow = own_flow(i);  // which depends on the one before
    if (i % 2 == 1) return std::nullopt;
    return flow;
  };
  EXPECT_TRUE(events_with(flow_of_every_second) == own_events());
}

TEST_P(EveryFlowSimulator, TakesAnyNumbersOfFlow) {
  const float numbers[] = {std::numeric_limits<float>::quiet_NaN(),
                           std::numeric_limits<float>::infinity(),
                           -1e38F,
                           1e-40F,
                           5,
                           -70000};
  EXPECT_FALSE(events_with([&](int i) {
                 Image<Flow> flow(width, height);
                 for (int y = 0; y < height; ++y)
                   for (int x = 0; x < width; ++x)
                     flow.at(x, y) = {numbers[(x + y * i) % 6], numbers[(x / 7 + y) % 6]};
                 return flow;
               }).empty());
  // What is not finite counts as 0.
  const auto with_all = [&](float number) {
    return events_with([&](int) {
      Image<Flow> flow(width, height);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) flow.at(x, y) = {number, number};
      return flow;
    });
  };
  EXPECT_TRUE(with_all(numbers[0]) == with_all(0));
  EXPECT_FALSE(with_all(3) == with_all(0));
}

TEST_P(EveryFlowSimulator, WritesTheFlowOfEachInterval) {
  Harness h = without_upload(GetParam().launch + std::string(" write-flow=true"));
  h.caps(video);
  for (int i = 0; i < frame_count; ++i) h.push(frame_of(i));
  for (int i = 0; i + 1 < frame_count; ++i) {
    const auto buffer = h.pull();
    ASSERT_TRUE(buffer);
    EXPECT_TRUE(flow_of(buffer.get()) == bytes_of(own_flow(i))) << i;
  }
  Harness silent(GetParam().launch);
  silent.caps(video);
  for (int i = 0; i < 2; ++i) silent.push(frame_of(i));
  EXPECT_EQ(flow_of(silent.pull().get()), "");
}

TEST(FlowOfFrames, EndsAtAFrameThatIsSkipped) {
  const auto events = [](bool has_flow) {
    Harness h("eventsim-dense qos=true");
    h.caps(video);
    h.push(has_flow ? frame_of(0, Image<Flow>(width, height)) : frame_of(0));
    gst_harness_push_upstream_event(
        h.get(), gst_event_new_qos(GST_QOS_TYPE_THROTTLE, 1, static_cast<gint64>(interval), 0));
    h.push(frame_of(1));
    h.push(frame_of(2));
    EXPECT_EQ(stat_of(h.element(), "skipped-frames"), 1U);
    return harness::bytes_of(h.pull().get());
  };
  EXPECT_TRUE(events(true) == events(false));
}

TEST(FlowOfFrames, MustHaveTheirSize) {
  Harness h("eventsim-dense");
  h.caps("video/x-raw, format=GRAY8, width=64, height=96, framerate=25/1");
  EXPECT_EQ(h.push(frame_of(0, Image<Flow>(width, height))), GST_FLOW_ERROR);
  EXPECT_TRUE(contains(h.error(), "Add the flow after the video is scaled or cropped"));
}

TEST(FlowOfFrames, IsNotWrittenWhereNoneIsNeeded) {
  Harness h("eventsim-dvs upsampling=linear write-flow=true");
  h.caps(video);
  for (int i = 0; i < 2; ++i) h.push(frame_of(i, Image<Flow>(width, height)));
  EXPECT_EQ(flow_of(h.pull().get()), "");
}

}  // namespace
