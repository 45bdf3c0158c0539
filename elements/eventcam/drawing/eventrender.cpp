// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventrender
 * @title: eventrender
 * @short_description: draws events as video
 *
 * Turns an event stream into video, at the framerate that downstream requests (default 30/1). A
 * picture shows the state at the end of its interval, PTS + duration.
 *
 * - `accumulate`: pixels with ON, OFF or both within a window;
 * - `decay`: the exponentially decaying sum of ON minus OFF;
 * - `time-surface`: age and polarity of the last event of each pixel;
 * - `count`: ON minus OFF within a window.
 *
 * The window is as long as a picture's interval, or #GstEventRender:accumulation-time; windows may
 * then overlap. #GstEventRender:event-count and #GstEventRender:area-event-count limit the window
 * by the number of events instead of by time.
 *
 * Pictures have the size of the sensor. A sensor of more than 8 million pixels is drawn at half its
 * size, or a third, and so on.
 *
 * Pictures continue without events: through GAP events and, from a live source, by the clock. Of a
 * pause of more than a minute there are pictures for a second only, with one warning. At framerate
 * 0/1 each buffer of events becomes one picture.
 *
 * Played slower, at a rate below 1, there are as many pictures a second as before, each of a
 * shorter interval. Events cannot be drawn backwards: a seek at a negative rate is refused.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-diff ! eventrender mode=decay !
 * video/x-raw,framerate=60/1 ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "elements/eventcam/drawing/frame_times.hpp"
#include "elements/eventcam/drawing/picture_qos.hpp"
#include "elements/eventcam/drawing/render_properties.hpp"
#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/authors.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/event_caps.hpp"
#include "gst/base/event_faults.hpp"
#include "gst/base/played_segment.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/render/renderer.hpp"

GST_DEBUG_CATEGORY_STATIC(event_render_debug);
#define GST_CAT_DEFAULT event_render_debug

using eventcamera::Microseconds;
using eventcamera::Renderer;

namespace {

/// Part of a longer pause that pictures show, so that the last one is empty.
constexpr GstClockTime shown_pause = GST_SECOND;

/// Maximum time to wait for the first input of a live source.
constexpr GstClockTime max_wait = 200 * GST_MSECOND;

/// State from caps to stop.
struct State {
  int width;  ///< of the sensor
  int height;
  Renderer renderer;
  std::optional<GstVideoInfo> video{};  ///< output format, once negotiated

  bool has_framerate() const { return GST_VIDEO_INFO_FPS_N(&*video) > 0; }
};

class EventRender final : public EventAggregator {
 public:
  explicit EventRender(GstAggregator* element)
      : EventAggregator(element, {.verb = "draw", .passes_main_pad = false}) {}

  void stop() override;
  void flush() override;
  void release_memory() noexcept override { state_.reset(); }
  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override;
  void handle_segment(const GstSegment& segment) override;
  GstFlowReturn aggregate(bool timed_out) override;
  GstClockTime next_time() override;

  GstFlowReturn choose_caps(GstCaps* downstream, GstCaps** result) const;
  bool set_video(const GstCaps* caps);

  Guarded<RenderProperties> settings;
  PictureQos qos;

 private:
  void drain();
  void start_over();
  bool approach(GstBuffer* buffer, const EventInterval& interval);
  bool add_events(const MappedEvents& mapped, const EventInterval& interval,
                  std::optional<GstClockTime> end, GstBuffer* buffer);
  GstFlowReturn handle_buffer(GstBuffer* buffer);
  void drop_buffer();
  void begin_pictures(GstClockTime start) {
    times_.emplace(start, *state_->video, segment_of(main_pad()).rate);
  }
  void begin_now();
  bool skip(const EventInterval& picture);
  bool has_begun_picture() const;
  GstFlowReturn acquire_buffer(GstBuffer** buffer);
  GstFlowReturn draw(const EventInterval& events, GstBuffer* buffer);
  GstFlowReturn push_picture(const EventInterval& events, const EventInterval& picture);
  GstFlowReturn push_next_picture();

  std::optional<State> state_;
  std::optional<FrameTimes> times_;  // interval of the next picture, once the first event is near
  std::optional<gsize> taken_;       // number of processed events of the first queued buffer
  GstClockTime known_ = 0;           // time up to which events are complete
  std::optional<GstClockTime> waiting_since_;  // for the first event; running time
  bool discontinuous_ = false;                 // the next picture is discontinuous
  WarnOnce warn_of_pause_{GST_CAT_DEFAULT};
};

/* events */

/// Adds the events of a buffer up to `end`, or all if there is none. Returns true if these were
/// all. May throw.
bool EventRender::add_events(const MappedEvents& mapped, const EventInterval& interval,
                             std::optional<GstClockTime> end, GstBuffer* buffer) {
  const auto rest = mapped.events().subspan(std::min(*taken_, mapped.events().size()));
  if (*taken_ == 0)
    GST_LOG_OBJECT(main_pad(), "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT, rest.size(),
                   GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
  const auto due = end && *end < interval.end
                       ? events_until(rest, mapped.start(), static_cast<Microseconds>(*end / 1000))
                       : rest;
  *taken_ += due.size();
  state_->renderer.configure(settings.copy().of_renderer());
  warn(state_->renderer.add(due, mapped.start(), length_of(interval)), buffer);
  return due.size() == rest.size();
}

void EventRender::drop_buffer() {
  taken_.reset();
  gst_aggregator_pad_drop_buffer(main_pad());
}

/// Advances to the time of a buffer. Returns true if a picture is due before the buffer can be
/// processed. May throw.
bool EventRender::approach(GstBuffer* buffer, const EventInterval& interval) {
  if (!taken_) {
    const bool returns =
        GST_BUFFER_IS_DISCONT(buffer) && interval.start + event_resolution < known_;
    const bool leaps = times_ && interval.start > times_->events().end + max_pause;
    if (returns || leaps) {
      GST_DEBUG_OBJECT(
          main_pad(), "starting over: time %s from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
          returns ? "goes back" : "leaps", GST_TIME_ARGS(known_), GST_TIME_ARGS(interval.start));
      start_over();
    }
    taken_ = 0;
  }
  const GstClockTime segment_start = segment_of(main_pad()).start;
  if (!times_ && state_->has_framerate() &&
      (interval.end > segment_start || interval.start >= segment_start))
    begin_pictures(std::max(interval.start, segment_start));
  return times_ && interval.start >= times_->events().end;
}

/// Adds the events of a buffer that are due, and pushes the picture that this completes, if any.
/// May throw.
GstFlowReturn EventRender::handle_buffer(GstBuffer* buffer) {
  auto interval = interval_of(buffer);
  if (!interval) {
    warn(interval_fault(buffer), buffer);
    drop_buffer();
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (gst_buffer_get_size(buffer) == 0 && interval->end - interval->start > max_pause &&
      state_->has_framerate()) {
    if (!taken_)
      warn_of_pause_(
          element(),
          {GST_STREAM_ERROR_FAILED,
           "The events pause for more than a minute; skipping the pictures of pauses."},
          "pause of " + std::to_string((interval->end - interval->start) / GST_SECOND) + " s");
    interval->end = interval->start + shown_pause;
  }
  if (approach(buffer, *interval)) return push_next_picture();
  std::optional<GstClockTime> due;
  if (times_) due = times_->events().end;
  bool all = false;
  {
    const MappedEvents mapped(buffer);
    if (!mapped) {
      warn(EventFault::partial_event, buffer);
      drop_buffer();
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
    all = add_events(mapped, *interval, due, buffer);
  }
  known_ = std::max(known_, interval->end);
  if (due && (!all || interval->end + event_resolution > *due)) return push_next_picture();
  drop_buffer();
  if (state_->has_framerate() || interval->end <= segment_of(main_pad()).start)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  return push_picture(*interval, *interval);
}

/// Starts the first picture now, because the live source has not sent events.
void EventRender::begin_now() {
  const GstSegment segment = segment_of(main_pad());
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element()));
  const guint64 position = gst_segment_position_from_running_time(&segment, GST_FORMAT_TIME, now);
  if (!GST_CLOCK_TIME_IS_VALID(position) || !state_->has_framerate()) return;
  GST_DEBUG_OBJECT(element(), "no events yet: first picture at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(position));
  begin_pictures(position);
}

GstFlowReturn EventRender::aggregate(bool timed_out) {
  GstAggregatorPad* pad = main_pad();
  if (timed_out) waiting_since_.reset();  // if no picture can start yet, wait again
  if (!state_ || !state_->video) {
    if (has_ended(pad)) return GST_FLOW_EOS;
    return gst_aggregator_pad_has_buffer(pad) ? GST_FLOW_NOT_NEGOTIATED
                                              : GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (const auto buffer = next_buffer(pad)) return handle_buffer(buffer.get());
  if (has_ended(pad)) return has_begun_picture() ? push_next_picture() : GST_FLOW_EOS;
  if (!timed_out) return GST_AGGREGATOR_FLOW_NEED_DATA;
  if (times_) return push_next_picture();
  begin_now();
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstClockTime EventRender::next_time() {
  if (!state_) return GST_CLOCK_TIME_NONE;
  if (times_)
    return running_time(main_pad(), times_->picture().start).value_or(GST_CLOCK_TIME_NONE);
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element()));
  if (!waiting_since_ && GST_CLOCK_TIME_IS_VALID(now)) waiting_since_ = now;
  return waiting_since_ ? *waiting_since_ + max_wait : GST_CLOCK_TIME_NONE;
}

/* pictures */

/// Skips a picture that sinks would drop anyway. False if it must be drawn.
bool EventRender::skip(const EventInterval& picture) {
  const auto time = running_time(main_pad(), picture.start);
  if (!qos.count_skipped(time)) return false;
  discontinuous_ = true;
  GST_DEBUG_OBJECT(element(), "downstream is late: skipped the picture at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(picture.start));
  const GstSegment segment = segment_of(main_pad());
  const GstClockTime stream_time =
      gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, picture.start);
  gst_element_post_message(GST_ELEMENT(element()),
                           qos.message(GST_ELEMENT(element()), picture, *time, stream_time));
  return true;
}

GstFlowReturn EventRender::draw(const EventInterval& events, GstBuffer* buffer) {
  const RenderProperties current = settings.copy();
  state_->renderer.configure(current.of_renderer());
  const VideoFrame frame(*state_->video, buffer, GST_MAP_WRITE);
  if (!frame) {
    GST_ELEMENT_ERROR(element(), RESOURCE, FAILED,
                      ("Cannot draw into an output buffer: %s. Check the element downstream.",
                       frame.fault().c_str()),
                      ("%" GST_PTR_FORMAT, buffer));
    return GST_FLOW_ERROR;
  }
  state_->renderer.draw(current.window_start(events), static_cast<Microseconds>(events.end / 1000),
                        pixel_layout_of(*state_->video), frame.data(), frame.stride());
  return GST_FLOW_OK;
}

GstFlowReturn EventRender::acquire_buffer(GstBuffer** buffer) {
  GstBufferPool* pool = gst_aggregator_get_buffer_pool(element());
  if (pool == nullptr) return GST_FLOW_NOT_NEGOTIATED;
  GstFlowReturn result = GST_FLOW_ERROR;
  if (gst_buffer_pool_set_active(pool, TRUE))  // GstAggregator does not activate it
    result = gst_buffer_pool_acquire_buffer(pool, buffer, nullptr);
  else
    GST_ELEMENT_ERROR(element(), RESOURCE, SETTINGS,
                      ("Cannot get output buffers; add a queue or a videoconvert downstream."),
                      ("gst_buffer_pool_set_active() failed for %" GST_PTR_FORMAT, pool));
  gst_object_unref(pool);
  return result;
}

/// Draws the state at the end of an interval and pushes it. May throw.
GstFlowReturn EventRender::push_picture(const EventInterval& events, const EventInterval& picture) {
  if (skip(picture)) return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstBuffer* acquired = nullptr;
  GstFlowReturn result = acquire_buffer(&acquired);
  if (result != GST_FLOW_OK) return result;
  OwnedBuffer buffer(acquired);
  result = draw(events, acquired);
  if (result != GST_FLOW_OK) return result;
  GST_BUFFER_PTS(acquired) = picture.start;
  GST_BUFFER_DTS(acquired) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(acquired) = picture.end - picture.start;
  if (std::exchange(discontinuous_, false)) GST_BUFFER_FLAG_SET(acquired, GST_BUFFER_FLAG_DISCONT);
  GST_LOG_OBJECT(element(),
                 "picture at %" GST_TIME_FORMAT " of the events from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 GST_TIME_ARGS(picture.start), GST_TIME_ARGS(events.start),
                 GST_TIME_ARGS(events.end));
  return push(std::move(buffer));
}

/// Draws the next picture and pushes it. May throw.
GstFlowReturn EventRender::push_next_picture() {
  const EventInterval events = times_->events();
  const EventInterval picture = times_->picture();
  const GstSegment segment = segment_of(main_pad());
  if (GST_CLOCK_TIME_IS_VALID(segment.stop) && picture.start >= segment.stop) return GST_FLOW_EOS;
  times_->next();
  return push_picture(events, picture);
}

/// True if there is input for the next picture.
bool EventRender::has_begun_picture() const {
  return state_ && state_->video && times_ && known_ > times_->events().start + event_resolution;
}

/// Pushes the incomplete last picture before a change. May throw.
void EventRender::drain() {
  if (has_begun_picture()) push_next_picture();
}

/* negotiation */

GstFlowReturn EventRender::choose_caps(GstCaps* downstream, GstCaps** result) const {
  if (!state_) return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstCaps* ours = gst_pad_get_pad_template_caps(GST_AGGREGATOR_SRC_PAD(element()));
  ours = gst_caps_make_writable(ours);
  gst_caps_set_simple(ours, "width", G_TYPE_INT, state_->renderer.width(), "height", G_TYPE_INT,
                      state_->renderer.height(), nullptr);
  *result = gst_caps_intersect_full(downstream, ours, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(ours);
  if (!gst_caps_is_empty(*result)) return GST_FLOW_OK;
  GST_ELEMENT_ERROR(element(), STREAM, FORMAT,
                    ("Cannot draw: the sensor has %dx%d pixels, and downstream does not take "
                     "pictures of that size in a format of this element. Insert eventscale before "
                     "this element, or videoconvertscale after it.",
                     state_->renderer.width(), state_->renderer.height()),
                    ("downstream takes %" GST_PTR_FORMAT, downstream));
  return GST_FLOW_NOT_NEGOTIATED;
}

bool EventRender::set_video(const GstCaps* caps) {
  GstVideoInfo video;
  if (!state_ || !gst_video_info_from_caps(&video, caps)) return false;
  state_->video = video;
  if (times_) {
    const GstClockTime start = times_->picture().start;
    times_.reset();
    if (state_->has_framerate()) begin_pictures(start);
  }
  const GstClockTime latency = frame_duration(video);
  GST_DEBUG_OBJECT(element(), "drawing %" GST_PTR_FORMAT ", latency %" GST_TIME_FORMAT, caps,
                   GST_TIME_ARGS(latency));
  gst_aggregator_set_latency(element(), latency, latency);
  return true;
}

bool EventRender::handle_caps(GstAggregatorPad*, GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) return false;
  if (state_ && state_->width == info.width && state_->height == info.height) return true;
  drain();
  state_.reset();  // before allocating the next: pictures can be large
  state_.emplace(State{info.width, info.height,
                       Renderer(info.width, info.height, settings.copy().of_renderer())});
  gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(element()));
  return true;
}

/* segments, states */

void EventRender::handle_segment(const GstSegment& segment) {
  if (continues(segment_of(main_pad()), segment)) return;
  drain();
  start_over();
}

/// Forgets all events, because the next input is discontinuous. May throw.
void EventRender::start_over() {
  if (state_) state_->renderer.reset();
  discontinuous_ |= times_.has_value();
  times_.reset();
  taken_.reset();
  known_ = 0;
  waiting_since_.reset();
}

void EventRender::flush() {
  qos.start_over();
  start_over();
}

void EventRender::stop() {
  state_.reset();
  flush();
  discontinuous_ = false;
  warn_of_pause_.reset();
  qos.reset_counts();
}

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventRender, gst_event_render, EVENT_RENDER, EventRender, eventrender,
                        GST_RANK_PRIMARY, "events drawn as video")

/// Consumes QoS events, because upstream would skip events.
static gboolean src_event(GstAggregator* element, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_QOS)
    return GST_AGGREGATOR_CLASS(gst_event_render_parent_class)->src_event(element, event);
  aggregator_impl<EventRender>(element).qos.handle_event(event);
  gst_event_unref(event);
  return TRUE;
}

static GstCaps* fixate_src_caps(GstAggregator*, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, 0), "framerate", 30, 1);
  return gst_caps_fixate(caps);
}

static gboolean decide_allocation(GstAggregator*, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  return decide_on_drawn_pool(query, caps);
}

static void gst_event_render_class_init(GstEventRenderClass* klass) {
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  add_render_properties(properties);

  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "sink", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC,
                              "video/x-raw, format = (string) " DRAWN_VIDEO_FORMATS ", " SIZE_CAPS
                              ", framerate = (fraction) [ 0, max ], "
                              "pixel-aspect-ratio = (fraction) 1/1");
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event renderer",
                                        "Codec/Decoder/Video", "Draws events as video",
                                        EVENTSIM_AUTHORS);

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->src_event = src_event;
  aggregator_class->fixate_src_caps = fixate_src_caps;
  aggregator_class->decide_allocation = decide_allocation;
  aggregator_class->update_src_caps = [](GstAggregator* element, GstCaps* caps, GstCaps** result) {
    return aggregator_impl<EventRender>(element).choose_caps(caps, result);
  };
  aggregator_class->negotiated_src_caps = [](GstAggregator* element, GstCaps* caps) -> gboolean {
    return aggregator_impl<EventRender>(element).set_video(caps);
  };
}
