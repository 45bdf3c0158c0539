// SPDX-License-Identifier: LGPL-2.1-or-later
// Segments without output, as of seeks with GST_SEEK_FLAG_SEGMENT, through every element that takes
// events or frames: each ends once, after its SEGMENT event.
#include <mutex>

#include "tests/elements/element_lines.hpp"

namespace {

using namespace harness;
using namespace element_lines;

/// Segments on a source pad.
class Output {
 public:
  explicit Output(GstPad* pad) {
    gst_pad_add_probe(
        pad, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM,
        +[](GstPad*, GstPadProbeInfo* info, gpointer self) {
          static_cast<Output*>(self)->take(GST_PAD_PROBE_INFO_EVENT(info));
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
  }

  /// Bases of the segments that ended; that of a segment in bytes is 0.
  std::vector<GstClockTime> ended() {
    const std::lock_guard lock(mutex_);
    return ended_;
  }

 private:
  void take(GstEvent* event) {
    const std::lock_guard lock(mutex_);
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) {
      const GstSegment* segment = nullptr;
      gst_event_parse_segment(event, &segment);
      base_ = segment->base;
    }
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE) ended_.push_back(base_);
  }

  std::mutex mutex_;
  GstClockTime base_ = GST_CLOCK_TIME_NONE;
  std::vector<GstClockTime> ended_;
};

/// Those that send a segment only with their first output: it has the times of that, and their
/// inputs are no recordings; GStreamer's base class of RTP payloaders does the same.
bool has_own_segment(const std::string& name) {
  return name == "evtparse" || name == "eventdatagramdepay" || name == "rtpeventpay";
}

std::vector<std::string> seekable_consumers() {
  auto names = consumers();
  std::erase_if(names, has_own_segment);
  return names;
}

class EveryConsumer : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryConsumer, testing::ValuesIn(seekable_consumers()),
                         element_lines::test_name);

TEST_P(EveryConsumer, EndsEachSegmentOnceAfterItsStart) {
  const Kind kind{GetParam()};
  const auto pipeline = launched(kind.launch());
  const Owned<GstElement> element(gst_bin_get_by_name(GST_BIN(pipeline.get()), "it"));
  std::vector<std::unique_ptr<Output>> outputs;
  for (GList* item = element->srcpads; item != nullptr; item = item->next)
    outputs.push_back(std::make_unique<Output>(GST_PAD(item->data)));
  std::vector<GstPad*> sources;
  for (const auto& pad : kind.pads(GST_PAD_SINK)) {
    GstPad* const sink = pad.presence == GST_PAD_REQUEST
                             ? gst_element_request_pad_simple(element.get(), pad.name.c_str())
                             : gst_element_get_static_pad(element.get(), pad.name.c_str());
    sources.push_back(gst_pad_new(nullptr, GST_PAD_SRC));
    ASSERT_EQ(gst_pad_link(sources.back(), sink), GST_PAD_LINK_OK) << pad.name;
    gst_object_unref(sink);
  }
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  std::size_t index = 0;
  for (const auto& pad : kind.pads(GST_PAD_SINK)) {
    GstPad* const source = sources[index++];
    gst_pad_set_active(source, TRUE);
    gst_pad_push_event(source, gst_event_new_stream_start(pad.name.c_str()));
    const Owned<GstCaps> caps(gst_caps_from_string(pad.takes_frames() ? frame_caps : event_caps));
    gst_pad_push_event(source, gst_event_new_caps(caps.get()));
  }
  for (const GstClockTime base : {0 * GST_SECOND, 1 * GST_SECOND}) {
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.base = base;
    segment.flags = GST_SEGMENT_FLAG_SEGMENT;
    for (auto* source : sources) gst_pad_push_event(source, gst_event_new_segment(&segment));
    for (auto* source : sources)
      gst_pad_push_event(source, gst_event_new_segment_done(GST_FORMAT_TIME, 0));
  }
  for (auto* source : sources) gst_pad_push_event(source, gst_event_new_eos());
  EXPECT_TRUE(wait_for(pipeline.get(), GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  for (const auto& output : outputs) {
    const auto ended = output->ended();
    EXPECT_TRUE(ended == (std::vector<GstClockTime>{0, 1 * GST_SECOND}) ||
                ended == (std::vector<GstClockTime>{0, 0}))
        << testing::PrintToString(ended);
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  for (auto* source : sources) gst_object_unref(source);
}

}  // namespace
