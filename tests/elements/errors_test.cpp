// SPDX-License-Identifier: LGPL-2.1-or-later
// Errors that elements post where GStreamer tries again what they refused.
#include <ostream>

#include "tests/elements/event_buffer.hpp"
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

constexpr auto events = "application/x-event-camera, format=XYTP, width=32, height=24";
constexpr auto large = "application/x-event-camera, format=XYTP, width=16384, height=16384";

struct Refusal {
  const char* launch;
  const char* caps;
  const char* error;
  double rate = 1;
};

void PrintTo(const Refusal& refusal, std::ostream* out) {
  *out << refusal.launch << ": " << refusal.error;
}

constexpr Refusal refusals[] = {
    {"eventcrop left=40", events, "Cannot filter the events: cropping 40 columns"},
    {"eventmask location=/nowhere", events, "Cannot filter the events: cannot read the mask"},
    {"eventtensor bins=256", large, "Cannot make tensors that take more than 1 GiB"},
    {"evtenc", large, "This file format cannot hold the stream"},
    {"evtparse", "application/x-event-camera, format=EVT3, framerate=0/1",
     "Cannot read this camera"},
    {"rtpeventpay", large, "EVT3 words support sensors of 1x1 to 2048x2048 pixels"},
    {"eventdatagramdepay width=32 height=24", "application/x-event-datagram",
     "Cannot receive events backwards", -1},
    {"eventstats", events, "Cannot measure events backwards", -1},
    {"evtdec", "application/x-event-camera, format=EVT3, width=32, height=24",
     "Cannot read events backwards", -1},
    {"evtparse", "application/x-event-camera, format=EVT3, width=32, height=24, framerate=0/1",
     "Cannot parse events backwards", -1},
    {"rtpeventdepay",
     "application/x-rtp, media=application, clock-rate=1000000, "
     "encoding-name=X-EVENT-CAMERA, width=32, height=24",
     "Cannot receive events backwards", -1},
    {"rtpeventpay", events, "Cannot send events backwards", -1},
};

class EveryRefusal : public testing::TestWithParam<Refusal> {};
INSTANTIATE_TEST_SUITE_P(, EveryRefusal, testing::ValuesIn(refusals));

/// Sticky events that are refused come again before each buffer and event that follows.
TEST_P(EveryRefusal, IsToldOncePerStart) {
  const auto& refusal = GetParam();
  Harness h(refusal.launch);
  for (int start = 0; start < 2; ++start) {
    gst_harness_set_src_caps_str(h.get(), refusal.caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.rate = refusal.rate;
    segment.stop = GST_SECOND;
    gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
    for (const GstClockTime time : {0, 10})
      h.push(buffer_of(time * GST_MSECOND, {{0, 1, 1}}, GST_MSECOND));
    gst_harness_push_event(h.get(), gst_event_new_eos());
    EXPECT_EQ(h.error().find(refusal.error), 0U);
    EXPECT_EQ(h.error(), "");
    gst_element_set_state(h->element, GST_STATE_READY);
    gst_element_set_state(h->element, GST_STATE_PLAYING);
    gst_harness_push_event(h.get(), gst_event_new_stream_start("again"));
  }
}

}  // namespace
