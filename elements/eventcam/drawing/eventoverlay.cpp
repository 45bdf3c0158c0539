// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventoverlay
 * @title: eventoverlay
 * @short_description: draws events over video
 *
 * Draws the events of the pad `event_sink` over the video of the pad `video_sink`. Each frame shows
 * the events of the interval that it starts, or of the #GstEventOverlay:accumulation-time before
 * the interval's end. Frames without a duration or framerate show the events since the last
 * one. The two streams are synchronized by running time. Events are scaled to the video if the
 * sensor has a different size. Grey video becomes RGB, unless downstream accepts only grey.
 *
 * Video from a live source waits for events no longer than its latency. Other video waits for the
 * events of its interval, or for a GAP event or EOS.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! tee name=t  t. ! queue ! videoconvert ! eventoverlay
 * name=overlay ! videoconvert ! autovideosink  t. ! queue ! eventsim-dvs ! overlay.event_sink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include <limits>

#include "elements/eventcam/drawing/frames_with_events.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "src/render/overlay.hpp"

GST_DEBUG_CATEGORY_STATIC(event_overlay_debug);
#define GST_CAT_DEFAULT event_overlay_debug

using namespace eventcamera;

namespace {

/// User-settable values, copied once per frame.
struct Settings {
  PaletteName palette = PaletteName::red_blue;
  gdouble opacity = 1;
  GstClockTime accumulation_time = 0;
};

bool is_grey(const GstStructure* video) {
  return g_strcmp0(gst_structure_get_string(video, "format"), "GRAY8") == 0;
}

class EventOverlay final : public FramesWithEvents {
 public:
  explicit EventOverlay(GstAggregator* element) : FramesWithEvents(element, GST_CAT_DEFAULT) {}

  void stop() override {
    FramesWithEvents::stop();
    drawn_.reset();
  }

  void flush() noexcept override {
    FramesWithEvents::flush();
    shown_.reset();
  }

  /// Grey video is drawn on in colour, unless downstream accepts only grey.
  OwnedCaps output_caps(GstCaps* input) override {
    OwnedCaps output(gst_caps_ref(input));
    if (is_grey(gst_caps_get_structure(input, 0))) {
      const OwnedCaps colours(gst_caps_copy(input));
      const OwnedCaps formats(
          gst_caps_from_string("video/x-raw, format = (string) " COLOUR_FORMATS));
      GstStructure* const fields = gst_caps_get_structure(colours.get(), 0);
      gst_structure_set_value(
          fields, "format",
          gst_structure_get_value(gst_caps_get_structure(formats.get(), 0), "format"));
      gst_structure_remove_field(fields, "colorimetry");
      OwnedCaps accepted(gst_pad_peer_query_caps(GST_AGGREGATOR_SRC_PAD(element()), colours.get()));
      if (!gst_caps_is_empty(accepted.get())) output.reset(gst_caps_fixate(accepted.release()));
    }
    GstVideoInfo drawn;
    if (gst_video_info_from_caps(&drawn, output.get())) drawn_ = drawn;
    return output;
  }

  OwnedCaps input_caps(OwnedCaps output) const override {
    OwnedCaps input(gst_caps_copy(output.get()));
    for (guint i = 0; i < gst_caps_get_size(output.get()); ++i) {
      GstStructure* const grey = gst_structure_copy(gst_caps_get_structure(output.get(), i));
      gst_structure_set(grey, "format", G_TYPE_STRING, "GRAY8", nullptr);
      gst_structure_remove_field(grey, "colorimetry");
      input.reset(gst_caps_merge_structure(input.release(), grey));
    }
    return input;
  }

  GstFlowReturn aggregate(bool timed_out) override {
    auto frame = next_buffer(main_pad());
    if (!frame) return has_ended(main_pad()) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
    const auto interval = video_ ? interval_of_frame(frame.get()) : std::nullopt;
    frame.reset();  // otherwise it would not be writable in place
    return video_ ? handle_frame(interval, timed_out) : GST_FLOW_NOT_NEGOTIATED;
  }

  Guarded<Settings> settings;

 private:
  void start_over() noexcept override { overlay_.reset(); }

  InvalidEvents add(std::span<const Event> events, Microseconds origin,
                    Microseconds length) override {
    return overlay_ ? overlay_->add(events, origin, length) : InvalidEvents{};
  }

  /// Interval during which a frame is shown, in running time; since the last frame if its end is
  /// unknown.
  std::optional<EventInterval> interval_of_frame(GstBuffer* frame) const {
    const GstClockTime start = GST_BUFFER_PTS(frame);
    if (!GST_CLOCK_TIME_IS_VALID(start) || start > G_MAXINT64) return std::nullopt;
    const GstClockTime duration =
        GST_BUFFER_DURATION_IS_VALID(frame) ? GST_BUFFER_DURATION(frame) : frame_duration(*video_);
    auto interval = running_interval(
        main_pad(), {start, start + std::min(duration, GstClockTime{G_MAXINT64} - start)});
    if (interval && duration == 0)
      interval->start = std::min(shown_.value_or(interval->end), interval->end);
    return interval;
  }

  /// A copy of a grey frame in the format of the output; the frame itself if it cannot be read.
  OwnedBuffer in_colour(GstBuffer* grey) const {
    OwnedBuffer colour(gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&*drawn_), nullptr));
    if (!colour) throw std::bad_alloc();
    gst_buffer_copy_into(
        colour.get(), grey,
        static_cast<GstBufferCopyFlags>(GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS), 0,
        static_cast<gsize>(-1));
    keep_metas(grey, colour.get());
    const VideoFrame from(*video_, grey, GST_MAP_READ);
    const VideoFrame to(*drawn_, colour.get(), GST_MAP_WRITE);
    if (!from || !to) return OwnedBuffer(gst_buffer_ref(grey));
    const auto layout = pixel_layout_of(*drawn_);
    for (int y = 0; y < GST_VIDEO_INFO_HEIGHT(&*drawn_); ++y) {
      const std::byte* in = from.data() + y * from.stride();
      std::byte* out = to.data() + y * to.stride();
      std::fill_n(out, GST_VIDEO_INFO_WIDTH(&*drawn_) * layout.bytes, std::byte{255});  // opaque
      for (int x = 0; x < GST_VIDEO_INFO_WIDTH(&*drawn_); ++x, ++in, out += layout.bytes)
        out[layout.red] = out[layout.green] = out[layout.blue] = *in;
    }
    return colour;
  }

  GstFlowReturn draw(const EventInterval& interval, GstBuffer* buffer) {
    const Settings current = settings.copy();
    const VideoFrame frame(*drawn_, buffer, static_cast<GstMapFlags>(GST_MAP_READWRITE));
    if (!frame) {
      GST_ELEMENT_ERROR(
          element(), RESOURCE, FAILED,
          ("Cannot draw on a video frame: %s. Check the element upstream.", frame.fault().c_str()),
          ("%" GST_PTR_FORMAT, buffer));
      return GST_FLOW_ERROR;
    }
    const auto end = microseconds(interval.end);
    const auto start = current.accumulation_time > 0 ? end - microseconds(current.accumulation_time)
                                                     : microseconds(interval.start);
    overlay_->draw(start, end, palette(current.palette), current.opacity, pixel_layout_of(*drawn_),
                   frame.data(), frame.stride());
    return GST_FLOW_OK;
  }

  GstFlowReturn handle_frame(const std::optional<EventInterval>& interval, bool timed_out) {
    if (interval) {
      if (sensor_ && !overlay_) {
        const SensorSize frame{GST_VIDEO_INFO_WIDTH(&*video_), GST_VIDEO_INFO_HEIGHT(&*video_)};
        GST_DEBUG_OBJECT(element(), "drawing the events of %dx%d pixels on frames of %dx%d",
                         sensor_->width, sensor_->height, frame.width, frame.height);
        overlay_.emplace(*sensor_, frame);
      }
      if (!add_events_until(interval->end) && !timed_out) return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
    OwnedBuffer out(gst_buffer_make_writable(gst_aggregator_pad_pop_buffer(main_pad())));
    if (interval) shown_ = interval->end;
    if (is_gap(out.get())) return push(std::move(out));
    GST_LOG_OBJECT(main_pad(),
                   "frame at %" GST_TIME_FORMAT "; events are known until %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(GST_BUFFER_PTS(out.get())), GST_TIME_ARGS(known_));
    if (GST_VIDEO_INFO_FORMAT(&*drawn_) != GST_VIDEO_INFO_FORMAT(&*video_))
      out = in_colour(out.get());
    if (interval && overlay_) {
      const GstFlowReturn result = draw(*interval, out.get());
      if (result != GST_FLOW_OK) return result;
    }
    return push(std::move(out));
  }

  std::optional<GstVideoInfo> drawn_;  // output; in colour where the video is grey
  std::optional<Overlay> overlay_;     // set once both sizes are known
  std::optional<GstClockTime> shown_;  // running time up to which frames were shown
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventOverlay, gst_event_overlay, EVENT_OVERLAY, EventOverlay,
                        eventoverlay, GST_RANK_NONE, "events drawn over video")

static void gst_event_overlay_class_init(GstEventOverlayClass* klass) {
  Properties<aggregator_settings<EventOverlay>> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::palette, "palette",
                 "Colours of pixels with ON events, OFF events, and both", palette_type());
  properties.add(&Settings::opacity, "opacity",
                 "Opacity of drawn events (0 = invisible, 1 = opaque)", 0, 1);
  properties.add(&Settings::accumulation_time, "accumulation-time",
                 "Time for which an event is shown (ns; 0 = one frame)", 0,
                 std::numeric_limits<gint64>::max());

#define DRAWN_VIDEO_CAPS                                               \
  "video/x-raw, format = (string) " DRAWN_VIDEO_FORMATS ", " SIZE_CAPS \
  ", framerate = (fraction) [ 0, max ]"
  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "video_sink", GST_PAD_SINK, DRAWN_VIDEO_CAPS);
  add_aggregator_pad_template(aggregator, "event_sink", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC, DRAWN_VIDEO_CAPS);
  set_metadata(klass, "Event overlay", "Filter/Editor/Video", "Draws events over video");
}
