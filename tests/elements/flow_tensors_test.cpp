// SPDX-License-Identifier: LGPL-2.1-or-later
// Simulators with optical flow on their pad flow_sink.
#include <cmath>
#include <limits>
#include <string>

#include "src/core/thread_pool.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/difference.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Flow;
using eventcamera::FlowMethod;
using eventcamera::Image;

constexpr int width = 96;
constexpr int height = 64;
constexpr int frame_count = 5;
constexpr GstClockTime interval = 40 * GST_MSECOND;

/// Frame of a pattern that moves by (3, 1) pixels per interval.
Image<std::uint8_t> frame(int i) {
  Image<std::uint8_t> image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at(x, y) = static_cast<std::uint8_t>(120 + 100 * std::sin((x - 3 * i) * 0.35) *
                                                           std::cos((y - i) * 0.27));
  return image;
}

GstClockTime time_of(int i) {
  return static_cast<GstClockTime>(i) * interval;
}

template <class Pixel>
GstBuffer* buffer_of(const Image<Pixel>& image, GstClockTime pts) {
  constexpr gsize row_size = width * sizeof(Pixel);
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, row_size * height, nullptr);
  for (int y = 0; y < height; ++y)
    gst_buffer_fill(buffer, static_cast<gsize>(y) * row_size, image.row(y), row_size);
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = interval;
  return buffer;
}

/// A simulator, its threshold in grey levels, and how it finds flow.
struct Simulator {
  const char* launch;
  int threshold;
  FlowMethod method;
};

constexpr Simulator simulators[] = {
    {"eventsim-dense", 2, FlowMethod::dis_lq},
    {"eventsim-dense interpolation=blend", 2, FlowMethod::dis_lq},
    {"eventsim-dvs upsampling=motion", 0, FlowMethod::dis_mq},
};

/// Flow as a simulator finds it.
class OwnFlow {
 public:
  explicit OwnFlow(const Simulator& simulator)
      : threshold_(simulator.threshold), finder_(simulator.method, width, height) {}

  /// From frame i to the next one.
  Image<Flow> from(int i) {
    last_ = frame(i);
    now_ = frame(i + 1);
    const auto found =
        finder_.find(last_.view(), now_.view(),
                     eventcamera::changed_box(last_.view(), now_.view(), threshold_), threads_);
    Image<Flow> flow(width, height);
    flow.assign(found);
    return flow;
  }

 private:
  int threshold_;
  Image<std::uint8_t> last_;
  Image<std::uint8_t> now_;
  eventcamera::ThreadPool threads_;
  eventcamera::RegionOfInterestFlow finder_;
};

struct FlowInput : TwoInputs {
  explicit FlowInput(const std::string& launch, const std::string& dimensions = "2:96:64:1",
                     const char* out = GST_EVENT_CAMERA_MEDIA_TYPE)
      : TwoInputs(launch, "sink", "flow_sink") {
    gst_harness_set_sink_caps_str(first.get(), out);
    gst_harness_set_src_caps_str(first.get(),
                                 "video/x-raw, format=GRAY8, width=96, height=64, framerate=25/1");
    gst_harness_set_src_caps_str(second.get(),
                                 ("other/tensors, format=static, num_tensors=1, types=float32, "
                                  "framerate=25/1, dimensions=" +
                                  dimensions)
                                     .c_str());
  }

  GstFlowReturn push_frame(int i) {
    return gst_harness_push(first.get(), buffer_of(frame(i), time_of(i)));
  }
  GstFlowReturn push_flow(int i, const Image<Flow>& flow) {
    return gst_harness_push(second.get(), buffer_of(flow, time_of(i)));
  }

  /// Bytes of the events since the last call.
  std::string events() {
    std::string bytes;
    while (const Buffer buffer{gst_harness_try_pull(first.get())}) bytes += bytes_of(buffer.get());
    return bytes;
  }

  std::string text_of_next(GstMessageType type) {
    const auto next = message(type);
    return next ? text_of(next.get()) : "";
  }
};

std::string events_of_own_flow(const std::string& launch) {
  Harness h(launch);
  h.caps("video/x-raw, format=GRAY8, width=96, height=64, framerate=25/1");
  std::string bytes;
  for (int i = 0; i < frame_count; ++i) h.push(buffer_of(frame(i), time_of(i)));
  while (const auto buffer = h.pull()) bytes += bytes_of(buffer.get());
  return bytes;
}

template <class FlowFrom>
std::string events_of_given_flow(const std::string& launch, FlowFrom flow_from) {
  FlowInput simulator(launch);
  for (int i = 0; i < frame_count; ++i) {
    EXPECT_EQ(simulator.push_flow(i, flow_from(i)), GST_FLOW_OK);
    EXPECT_EQ(simulator.push_frame(i), GST_FLOW_OK);
  }
  EXPECT_EQ(simulator.text_of_next(GST_MESSAGE_WARNING), "");
  return simulator.events();
}

TEST(FlowTensors, ReplaceTheFlowThatTheSimulatorFinds) {
  for (const auto& simulator : simulators) {
    const auto expected = events_of_own_flow(simulator.launch);
    EXPECT_GT(expected.size(), 8000U);
    OwnFlow own(simulator);
    const auto given = events_of_given_flow(simulator.launch, [&](int i) { return own.from(i); });
    EXPECT_TRUE(given == expected) << simulator.launch;
    const auto still =
        events_of_given_flow(simulator.launch, [](int) { return Image<Flow>(width, height); });
    EXPECT_FALSE(still == expected) << simulator.launch;
  }
}

TEST(FlowTensors, AreUsedForPictures) {
  FlowInput simulator("eventsim-dense", "2:96:64:1", "video/x-raw, format=GRAY8");
  for (int i = 0; i < frame_count; ++i) {
    EXPECT_EQ(simulator.push_flow(i, Image<Flow>(width, height)), GST_FLOW_OK);
    EXPECT_EQ(simulator.push_frame(i), GST_FLOW_OK);
  }
  EXPECT_EQ(simulator.text_of_next(GST_MESSAGE_WARNING), "");
}

TEST(FlowTensors, AreNotUsedWithoutMotion) {
  FlowInput simulator("eventsim-dvs");
  for (int i = 0; i < frame_count; ++i) EXPECT_EQ(simulator.push_frame(i), GST_FLOW_OK);
  EXPECT_TRUE(simulator.events() == events_of_own_flow("eventsim-dvs"));
}

TEST(FlowTensors, MayBeMissing) {
  for (const auto& settings : simulators) {
    FlowInput simulator(settings.launch);
    OwnFlow own(settings);
    for (int i = 0; i < frame_count; ++i) {
      const auto flow = own.from(i);
      if (i % 2 == 0)
        EXPECT_EQ(simulator.push_flow(i, flow), GST_FLOW_OK);
      else
        gst_harness_push_event(simulator.second.get(),
                               gst_event_new_gap(time_of(i), interval + GST_USECOND));
      EXPECT_EQ(simulator.push_frame(i), GST_FLOW_OK);
    }
    EXPECT_TRUE(simulator.text_of_next(GST_MESSAGE_WARNING)
                    .starts_with("The optical flow of a frame is missing: finding it here."));
    EXPECT_TRUE(simulator.events() == events_of_own_flow(settings.launch)) << settings.launch;
  }
}

TEST(FlowTensors, MustHaveTheSizeOfTheVideo) {
  FlowInput simulator("eventsim-dense", "2:64:96");
  simulator.push_flow(0, Image<Flow>(width, height));
  simulator.push_frame(0);
  EXPECT_EQ(simulator.push_frame(1), GST_FLOW_ERROR);
  EXPECT_EQ(simulator.text_of_next(GST_MESSAGE_ERROR),
            "The optical flow has the dimensions 2:64:96, and the video needs 2:96:64:1.");
}

TEST(FlowTensors, MustHoldTheirPixels) {
  FlowInput simulator("eventsim-dense");
  GstBuffer* const small = gst_buffer_new_allocate(nullptr, 100, nullptr);
  GST_BUFFER_PTS(small) = 0;
  gst_harness_push(simulator.second.get(), small);
  simulator.push_frame(0);
  EXPECT_EQ(simulator.push_frame(1), GST_FLOW_ERROR);
  EXPECT_EQ(simulator.text_of_next(GST_MESSAGE_ERROR),
            "Cannot read a tensor of optical flow: it has 100 bytes instead of 49152. Check the "
            "element upstream.");
}

TEST(FlowTensors, MayHoldAnyNumbers) {
  for (const auto& simulator : simulators) {
    const float numbers[] = {std::numeric_limits<float>::quiet_NaN(),
                             std::numeric_limits<float>::infinity(),
                             -1e38F,
                             1e-40F,
                             5,
                             -70000};
    events_of_given_flow(simulator.launch, [&](int i) {
      Image<Flow> flow(width, height);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          flow.at(x, y) = {numbers[(x + y * i) % 6], numbers[(x / 7 + y) % 6]};
      return flow;
    });
  }
}

}  // namespace
