// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-flowjoin
 * @title: flowjoin
 * @short_description: adds known optical flow to video frames
 *
 * Adds to each frame of the pad `video_sink` the optical flow that begins at its time on the pad
 * `flow_sink`, such as a renderer's, as a #GstEventCameraFlowMeta. Simulators that need optical
 * flow use it instead of estimating it.
 *
 * Flow is a tensor of NNStreamer with the dimensions 2:width:height:1: how far each pixel moves to
 * the right and down until the next frame, in pixels. Video and flow are synchronized by running
 * time. A frame without flow passes unchanged; so does one whose flow covers less than half or more
 * than one and a half of its duration.
 *
 * Video from a live source waits for flow no longer than its latency. Other video waits for the
 * next tensor, or for a GAP event or EOS.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=30 ! flowjoin name=join ! eventsim-dense !
 * fakesink  videotestsrc pattern=black num-buffers=30 ! video/x-raw,format=GRAY8,width=2560 !
 * capssetter join=false replace=true
 * caps="other/tensors,format=static,num_tensors=1,types=float32,dimensions=2:320:240:1" !
 * join.flow_sink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include <string_view>

#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(flow_join_debug);
#define GST_CAT_DEFAULT flow_join_debug

namespace {

/// True if these are the dimensions of a flow; further ones are 1.
bool are_dimensions(std::string_view dimensions, const std::string& of_flow) {
  if (!dimensions.starts_with(of_flow)) return false;
  dimensions.remove_prefix(of_flow.size());
  while (dimensions.starts_with(":1")) dimensions.remove_prefix(2);
  return dimensions.empty();
}

class FlowJoin final : public EventAggregator {
 public:
  explicit FlowJoin(GstAggregator* element)
      : EventAggregator(element, {.verb = "join", .main_pad = "video_sink"}) {}

  void stop() override {
    size_.reset();
    dimensions_.clear();
    warn_of_missing_.reset();
    warn_of_no_flow_.reset();
  }

  void flush() noexcept override {}

  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override {
    const GstStructure* const structure = gst_caps_get_structure(caps, 0);
    if (pad == flow_pad_) {
      const char* const dimensions = gst_structure_get_string(structure, "dimensions");
      dimensions_ = dimensions != nullptr ? dimensions : "none";
      return true;
    }
    Size size;
    if (!gst_structure_get_int(structure, "width", &size.width) ||
        !gst_structure_get_int(structure, "height", &size.height))
      return false;
    size_ = size;
    GstVideoInfo video;
    frame_duration_ = gst_video_info_from_caps(&video, caps) ? frame_duration(video) : 0;
    // Flow to a frame is not known before the frame.
    gst_aggregator_set_latency(element(), frame_duration_, frame_duration_);
    if (!gst_pad_is_linked(GST_PAD(flow_pad_)))
      warn_of_missing_(element(),
                       {GST_CORE_ERROR_PAD,
                        "No optical flow: link a source of tensors to the pad \"flow_sink\". Until "
                        "then, video from a live source passes unchanged, and other video waits."},
                       "the pad \"flow_sink\" is not linked");
    return true;
  }

  GstFlowReturn aggregate(bool timed_out) override {
    auto frame = next_buffer(main_pad());
    if (!frame) return has_ended(main_pad()) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
    if (!size_) return GST_FLOW_NOT_NEGOTIATED;
    OwnedBuffer flow;
    if (const auto time = running_time(main_pad(), GST_BUFFER_PTS(frame.get()))) {
      auto [result, found] = flow_at(*time);
      if (result == GST_AGGREGATOR_FLOW_NEED_DATA && !timed_out) return result;
      if (found && covers(found.get(), frame.get())) flow = std::move(found);
    }
    frame.reset();  // otherwise it would not be writable in place
    OwnedBuffer out(gst_buffer_make_writable(gst_aggregator_pad_pop_buffer(main_pad())));
    if (is_gap(out.get())) return push(std::move(out));
    if (flow && !add_flow(out.get(), flow.get())) return GST_FLOW_ERROR;
    if (!flow && !has_ended(flow_pad_))
      warn_of_no_flow_(element(),
                       {GST_STREAM_ERROR_FORMAT,
                        "A frame has no optical flow; passing it without. Give the flow from a "
                        "frame to the next one the PTS and the duration of the frame."},
                       "no matching buffer on flow_sink");
    return push(std::move(out));
  }

 private:
  struct Size {
    gint width = 0;
    gint height = 0;
  };

  /// Takes the flow that begins at a running time from the queue; null if there is none. More data
  /// is needed if it may still arrive.
  std::pair<GstFlowReturn, OwnedBuffer> flow_at(GstClockTime time) {
    while (auto next = next_buffer(flow_pad_)) {
      const GstClockTime pts = GST_BUFFER_PTS(next.get());
      const auto start = running_time(flow_pad_, pts);
      if (is_gap(next.get())) {
        const GstClockTime duration = GST_BUFFER_DURATION(next.get());
        const auto end =
            GST_CLOCK_TIME_IS_VALID(duration) ? running_time(flow_pad_, pts + duration) : start;
        if (end && *end > time) return {GST_FLOW_OK, nullptr};
      } else if (start && *start >= time + event_resolution) {
        return {GST_FLOW_OK, nullptr};
      }
      gst_aggregator_pad_drop_buffer(flow_pad_);
      if (!is_gap(next.get()) && start && *start + event_resolution > time)
        return {GST_FLOW_OK, std::move(next)};
      GST_LOG_OBJECT(flow_pad_, "no frame for %" GST_PTR_FORMAT, next.get());
    }
    return {has_ended(flow_pad_) ? GST_FLOW_OK : GST_AGGREGATOR_FLOW_NEED_DATA, nullptr};
  }

  /// True if flow that begins with a frame covers the frame's duration, as far as is known. It does
  /// not if frames were skipped upstream of one of the pads.
  bool covers(GstBuffer* flow, GstBuffer* frame) const {
    const GstClockTime duration = GST_BUFFER_DURATION(flow);
    const GstClockTime expected =
        GST_BUFFER_DURATION_IS_VALID(frame) ? GST_BUFFER_DURATION(frame) : frame_duration_;
    if (!GST_CLOCK_TIME_IS_VALID(duration) || expected == 0) return true;
    return duration > expected / 2 && duration - expected / 2 < expected;
  }

  /// Returns false, after an error message, if the flow does not have the size of the frame.
  bool add_flow(GstBuffer* frame, GstBuffer* flow) {
    const auto expected = "2:" + std::to_string(size_->width) + ":" + std::to_string(size_->height);
    if (!are_dimensions(dimensions_, expected)) {
      post_message(
          element(), GST_MESSAGE_ERROR,
          {GST_CORE_ERROR_NEGOTIATION, "The optical flow has the dimensions " + dimensions_ +
                                           ", and the video needs " + expected + ":1."},
          "caps of video_sink and flow_sink");
      return false;
    }
    const auto width = static_cast<guint>(size_->width);
    const auto height = static_cast<guint>(size_->height);
    const gsize size = gsize{width} * height * 2 * sizeof(gfloat);
    gpointer bytes = nullptr;
    gsize actual = 0;
    gst_buffer_extract_dup(flow, 0, G_MAXSIZE, &bytes, &actual);
    GBytes* const owned = g_bytes_new_take(bytes, actual);
    const bool fits = actual == size;
    if (fits)
      gst_buffer_add_event_camera_flow_meta(frame, width, height, owned);
    else
      post_message(
          element(), GST_MESSAGE_ERROR,
          {GST_RESOURCE_ERROR_FAILED, "Cannot read a tensor of optical flow: it has " +
                                          std::to_string(actual) + " bytes instead of " +
                                          std::to_string(size) + ". Check the element upstream."},
          "size of a buffer of flow_sink");
    g_bytes_unref(owned);
    return fits;
  }

  GstAggregatorPad* const flow_pad_ = pad("flow_sink");

  std::optional<Size> size_;         ///< of the video
  GstClockTime frame_duration_ = 0;  ///< of the video's framerate; 0 if variable
  std::string dimensions_;           ///< of the next tensor
  WarnOnce warn_of_missing_{GST_CAT_DEFAULT};
  WarnOnce warn_of_no_flow_{GST_CAT_DEFAULT};
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstFlowJoin, gst_flow_join, FLOW_JOIN, FlowJoin, flowjoin, GST_RANK_NONE,
                        "optical flow of video frames")

static void gst_flow_join_class_init(GstFlowJoinClass* klass) {
#define ANY_VIDEO_CAPS "video/x-raw(ANY), " SIZE_CAPS ", framerate = (fraction) [ 0, max ]"
  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "video_sink", GST_PAD_SINK, ANY_VIDEO_CAPS);
  add_aggregator_pad_template(
      aggregator, "flow_sink", GST_PAD_SINK,
      "other/tensors, format = (string) static, num_tensors = (int) 1, types = (string) float32");
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC, ANY_VIDEO_CAPS);
  set_metadata(klass, "Optical flow joiner", "Filter/Video",
               "Adds known optical flow to video frames");
}
