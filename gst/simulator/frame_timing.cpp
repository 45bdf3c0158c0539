// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/frame_timing.hpp"

using eventcamera::Nanoseconds;

/// Changes the latency, and posts a message if it differs.
template <class Change>
void FrameTiming::change_latency(const Change& change) {
  GstClockTime before = 0;
  GstClockTime after = 0;
  {
    const auto latency = latency_.lock();
    before = latency->total();
    change(*latency);
    after = latency->total();
  }
  if (after == before) return;
  GST_CAT_DEBUG_OBJECT(category_, element_, "latency is now %" GST_TIME_FORMAT,
                       GST_TIME_ARGS(after));
  gst_element_post_message(GST_ELEMENT(element_), gst_message_new_latency(GST_OBJECT(element_)));
}

bool FrameTiming::begin(GstBuffer* frame, bool skippable) {
  GstMessage* skipped = qos_.lock()->begin(element_, frame, skippable);
  if (skipped == nullptr) return true;
  GST_CAT_DEBUG_OBJECT(category_, element_, "downstream is late: skipped %" GST_PTR_FORMAT, frame);
  gst_element_post_message(GST_ELEMENT(element_), skipped);
  return false;
}

void FrameTiming::end_work(Nanoseconds time, std::optional<Nanoseconds> began) {
  Nanoseconds work = 0;
  Nanoseconds downstream = 0;
  {
    const auto qos = qos_.lock();
    work = qos->end_work(element_, began);
    downstream = qos->downstream_latency();
  }
  change_latency([&](IntervalLatency& latency) { latency.add_work(time, work, downstream); });
}

void FrameTiming::expect(Nanoseconds duration) {
  change_latency([&](IntervalLatency& latency) { latency.expect(duration); });
}

void FrameTiming::add_interval(Nanoseconds start, Nanoseconds end) {
  change_latency([&](IntervalLatency& latency) { latency.add_interval(start, end); });
}
