// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventfuse
 * @title: eventfuse
 * @short_description: fuses grey video and events into video of any framerate
 *
 * Shows the brightness at any time between the frames of the pad `video_sink` from the events of
 * the pad `event_sink`, at the framerate that downstream requests (default: the video's). A
 * complementary filter (Scheerlinck, Barnes and Mahony, ACCV 2018) adds the events of each pixel,
 * and pulls it towards the last frame, the faster the higher the #GstEventFuse:cutoff is.
 * docs/reconstruction.md has the equations.
 *
 * Both inputs must have the same size. Insert videoconvert before `video_sink` if the video is not
 * grey. The two streams are synchronized by running time. A discontinuity of the video starts over
 * with its frame. A frame lasts for a minute at most.
 *
 * Video from a live source waits for events no longer than its latency. Other video waits for the
 * events up to a picture, or for a GAP event or EOS.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! video/x-raw,format=GRAY8 ! tee name=t  t. ! queue !
 * eventfuse name=fuse ! video/x-raw,framerate=120/1 ! videoconvert ! autovideosink  t. ! queue !
 * eventsim-dvs ! fuse.event_sink
 * ]|
 *
 * Since: 0.1
 */
#include "elements/eventcam/drawing/frame_times.hpp"
#include "elements/eventcam/drawing/frames_with_events.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/video_frame.hpp"
#include "src/reconstruct/complementary_filter.hpp"

GST_DEBUG_CATEGORY_STATIC(event_fuse_debug);
#define GST_CAT_DEFAULT event_fuse_debug

namespace {

using namespace eventcamera;

class EventFuse final : public FramesWithEvents {
 public:
  explicit EventFuse(GstAggregator* element) : FramesWithEvents(element, GST_CAT_DEFAULT) {}

  void stop() override {
    FramesWithEvents::stop();
    discontinuous_ = false;
    warn_of_size_.reset();
  }

  void flush() noexcept override {
    FramesWithEvents::flush();
    times_.reset();
  }

  void handle_segment(const GstSegment& segment) override {
    if (!continues(segment_of(main_pad()), segment)) jump();
  }

  /// The video's caps with the nearest framerate that downstream accepts.
  OwnedCaps output_caps(GstCaps* input) override {
    const OwnedCaps any = input_caps(OwnedCaps(gst_caps_ref(input)));
    OwnedCaps output(gst_pad_peer_query_caps(GST_AGGREGATOR_SRC_PAD(element()), any.get()));
    output.reset(gst_caps_is_empty(output.get()) ? gst_caps_ref(input)
                                                 : gst_caps_truncate(output.release()));
    output.reset(gst_caps_make_writable(output.release()));
    gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(output.get(), 0),
                                                "framerate", GST_VIDEO_INFO_FPS_N(&*video_),
                                                GST_VIDEO_INFO_FPS_D(&*video_));
    output.reset(gst_caps_fixate(output.release()));
    if (!gst_video_info_from_caps(&output_, output.get())) return output;
    if (times_) begin_pictures(std::exchange(times_, {})->picture().start);
    return output;
  }

  OwnedCaps input_caps(OwnedCaps output) const override {
    OwnedCaps input(gst_caps_make_writable(output.release()));
    gst_caps_set_simple(input.get(), "framerate", GST_TYPE_FRACTION_RANGE, 0, 1, G_MAXINT, 1,
                        nullptr);
    return input;
  }

  GstFlowReturn aggregate(bool timed_out) override {
    const auto frame = next_buffer(main_pad());
    if (frame) return video_ ? handle_frame(frame.get(), timed_out) : GST_FLOW_NOT_NEGOTIATED;
    if (has_ended(main_pad())) return GST_FLOW_EOS;
    return timed_out && times_ ? push_next_picture(true) : GST_AGGREGATOR_FLOW_NEED_DATA;
  }

  /// Time at which the next picture of a live source is pushed without waiting for input.
  GstClockTime next_time() override {
    return times_ && !has_ended(main_pad()) ? running(times_->picture().start)
                                            : FramesWithEvents::next_time();
  }

  Guarded<ComplementaryFilter::Settings> settings;

 private:
  void start_over() noexcept override {
    filter_.reset();
    is_shown_ = false;
  }

  /// Starts over at the time of the next frame.
  void jump() {
    start_over();
    discontinuous_ |= times_.has_value();
    times_.reset();
  }

  GstClockTime running(GstClockTime time) const {
    return running_time(main_pad(), time).value_or(0);
  }

  void begin_pictures(GstClockTime start) {
    if (GST_VIDEO_INFO_FPS_N(&output_) > 0)
      times_.emplace(start, output_, segment_of(main_pad()).rate);
  }

  ComplementaryFilter::Settings running_settings() const {
    auto current = settings.copy();
    current.cutoff *= segment_of(main_pad()).rate;
    return current;
  }

  InvalidEvents add(std::span<const Event> events, Microseconds origin,
                    Microseconds length) override {
    if (!filter_) return {};
    const SensorSize frame{GST_VIDEO_INFO_WIDTH(&*video_), GST_VIDEO_INFO_HEIGHT(&*video_)};
    if (sensor_ != frame) {
      warn_of_size_(element(),
                    {GST_STREAM_ERROR_FORMAT,
                     "Skipping events: the sensor has another size than the frames. Insert "
                     "eventscale or videoscale before this element."},
                    "frames of " + std::to_string(frame.width) + "x" +
                        std::to_string(frame.height) + " pixels");
      return {};
    }
    filter_->configure(running_settings());
    return filter_->add(events, origin, length);
  }

  /// Interval in which a frame is the last one, within the segment. Durations may be erroneous.
  EventInterval interval_of_frame(GstBuffer* frame) const {
    const GstClockTime duration =
        GST_BUFFER_DURATION_IS_VALID(frame) ? GST_BUFFER_DURATION(frame) : frame_duration(*video_);
    const GstClockTime start = GST_BUFFER_PTS_IS_VALID(frame) ? GST_BUFFER_PTS(frame) : shown_.end;
    const GstClockTime end = start + std::clamp(duration, GstClockTime{1}, max_pause);
    return {std::max(start, segment_of(main_pad()).start), end};
  }

  /// Passes the first queued frame to the filter, and pushes the next picture.
  GstFlowReturn handle_frame(GstBuffer* frame, bool timed_out) {
    const EventInterval interval = is_shown_ ? shown_ : interval_of_frame(frame);
    // Before the segment, or an erroneous time, after which pictures would wrap around.
    if (interval.start >= interval.end || interval.end > GstClockTime{G_MAXINT64})
      return drop_frame();
    if (!is_shown_) {
      const bool leaps = times_ && interval.start > times_->picture().start + max_pause;
      if (GST_BUFFER_IS_DISCONT(frame) || leaps) jump();
      if (times_ && times_->picture().start < interval.start) return push_next_picture(timed_out);
      if (is_gap(frame) && !filter_) {
        drop_frame();
        return push_gap(interval.start, interval.end - interval.start);
      }
      if (!add_events_until(running(interval.start)) && !timed_out)
        return GST_AGGREGATOR_FLOW_NEED_DATA;
      if (!is_gap(frame) && !show(frame, interval.start)) return GST_FLOW_ERROR;
      if (!times_) begin_pictures(interval.start);
      is_shown_ = true;
      shown_ = interval;
    }
    if (times_ && times_->picture().start < interval.end) return push_next_picture(timed_out);
    const bool is_picture = GST_VIDEO_INFO_FPS_N(&output_) == 0 && !is_gap(frame);
    drop_frame();
    return is_picture ? push_picture(interval) : GST_AGGREGATOR_FLOW_NEED_DATA;
  }

  GstFlowReturn drop_frame() {
    is_shown_ = false;
    gst_aggregator_pad_drop_buffer(main_pad());
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }

  /// Passes a frame to the filter. Returns false after reporting why it cannot.
  bool show(GstBuffer* buffer, GstClockTime start) {
    const VideoFrame frame(*video_, buffer, GST_MAP_READ);
    if (!frame) {
      post_message(element(), GST_MESSAGE_ERROR, cannot_read(frame.fault()), frame.fault());
      return false;
    }
    const ImageView<std::uint8_t> view{reinterpret_cast<const std::uint8_t*>(frame.data()),
                                       frame.stride(), GST_VIDEO_INFO_WIDTH(&*video_),
                                       GST_VIDEO_INFO_HEIGHT(&*video_)};
    const auto time = microseconds(running(start));
    if (filter_)
      filter_->set_frame(view, time);
    else
      filter_.emplace(view, time, running_settings());
    return true;
  }

  /// Pushes the next picture, once all events before it are known or the deadline has passed.
  GstFlowReturn push_next_picture(bool timed_out) {
    const EventInterval picture = times_->picture();
    const GstSegment segment = segment_of(main_pad());
    if (GST_CLOCK_TIME_IS_VALID(segment.stop) && picture.start >= segment.stop) return GST_FLOW_EOS;
    if (!add_events_until(running(picture.start)) && !timed_out)
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    times_->next();
    return push_picture(picture);
  }

  /// Draws the state at the start of an interval and pushes it.
  GstFlowReturn push_picture(const EventInterval& interval) {
    if (!filter_) {  // the size has changed
      discontinuous_ = true;
      return GST_FLOW_OK;
    }
    OwnedBuffer buffer(gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&output_), nullptr));
    if (!buffer) throw std::bad_alloc();
    {
      const VideoFrame picture(output_, buffer.get(), GST_MAP_WRITE);
      filter_->draw(microseconds(running(interval.start)), picture.data(), picture.stride());
    }
    stamp(buffer.get(), interval, discontinuous_);
    GST_LOG_OBJECT(element(), "picture at %" GST_TIME_FORMAT, GST_TIME_ARGS(interval.start));
    return push(std::move(buffer));
  }

  GstVideoInfo output_{};
  std::optional<ComplementaryFilter> filter_;  // from the first frame
  std::optional<FrameTimes> times_;  // of the next picture, from the first frame at a framerate
  bool is_shown_ = false;            // the filter has the first queued frame
  EventInterval shown_{};            // of the last frame
  bool discontinuous_ = false;       // the next picture is discontinuous
  WarnOnce warn_of_size_{GST_CAT_DEFAULT};
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventFuse, gst_event_fuse, EVENT_FUSE, EventFuse, eventfuse,
                        GST_RANK_NONE, "video from frames and events")

static void gst_event_fuse_class_init(GstEventFuseClass* klass) {
  using Settings = ComplementaryFilter::Settings;
  Properties<aggregator_settings<EventFuse>> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::cutoff, "cutoff",
                 "Frequency below which frames decide, and above which events do (Hz; 0 = events "
                 "only, after the first frame)",
                 0, 1000);
  properties.add(&Settings::positive_threshold, "positive-threshold",
                 "Rise of the logarithmic brightness by an ON event", 1e-3, 10);
  properties.add(&Settings::negative_threshold, "negative-threshold",
                 "Fall of the logarithmic brightness by an OFF event", 1e-3, 10);

#define FUSED_VIDEO_CAPS \
  "video/x-raw, format = (string) GRAY8, " SIZE_CAPS ", framerate = (fraction) [ 0, max ]"
  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "video_sink", GST_PAD_SINK, FUSED_VIDEO_CAPS);
  add_aggregator_pad_template(aggregator, "event_sink", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC, FUSED_VIDEO_CAPS);
  set_metadata(klass, "Event fusion", "Filter/Converter/Video",
               "Fuses grey video and events into video of any framerate");
}
