// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/drawing/event_pictures.hpp"

#include "gst/base/properties.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/drawing/drawn_video.hpp"

#define GST_CAT_DEFAULT category_

using namespace eventcamera;

namespace {

/// Part of a longer pause that pictures show, so that the last one is empty.
constexpr GstClockTime shown_pause = GST_SECOND;

/// Maximum time to wait for the first input of a live source.
constexpr GstClockTime max_wait = 200 * GST_MSECOND;

}  // namespace

EventPictures::EventPictures(GstAggregator* element, GstDebugCategory* category)
    : EventAggregator(element, {.verb = "draw", .passes_main_pad = false}),
      category_(category),
      warn_of_pause_(category) {}

/// Adds the events of a buffer up to `end`, or all if there is none. Returns true if these were
/// all.
bool EventPictures::add_events(const MappedEvents& mapped, const EventInterval& interval,
                               std::optional<GstClockTime> end, GstBuffer* buffer) {
  const auto rest = mapped.events().subspan(std::min(*processed_, mapped.events().size()));
  if (*processed_ == 0)
    GST_LOG_OBJECT(main_pad(), "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT, rest.size(),
                   GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
  const auto due =
      end && *end < interval.end ? events_until(rest, mapped.start(), microseconds(*end)) : rest;
  *processed_ += due.size();
  state_->renderer.configure(render_settings());
  warn(state_->renderer.add(due, mapped.start(), length_of(interval)), buffer);
  return due.size() == rest.size();
}

void EventPictures::drop_buffer() {
  processed_.reset();
  gst_aggregator_pad_drop_buffer(main_pad());
}

/// Starts over if a buffer is too far from the last one, and starts the pictures if there are none
/// yet.
void EventPictures::advance_to(GstBuffer* buffer, const EventInterval& interval) {
  if (!processed_) {
    const bool returns =
        GST_BUFFER_IS_DISCONT(buffer) && interval.start + event_resolution < known_;
    const bool leaps = times_ && interval.start > times_->events().end + max_pause;
    if (returns || leaps) {
      GST_DEBUG_OBJECT(
          main_pad(), "starting over: time %s from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
          returns ? "goes back" : "leaps", GST_TIME_ARGS(known_), GST_TIME_ARGS(interval.start));
      start_over();
    }
    processed_ = 0;
  }
  const GstClockTime segment_start = segment_of(main_pad()).start;
  if (!times_ && state_->has_framerate() &&
      (interval.end > segment_start || interval.start >= segment_start))
    begin_pictures(std::max(interval.start, segment_start));
}

/// Adds the events of a buffer that are due, and pushes the picture that this completes, if any.
GstFlowReturn EventPictures::handle_buffer(GstBuffer* buffer) {
  auto interval = interval_of(buffer);
  if (!interval) {
    warn(event_fault(buffer), buffer);
    drop_buffer();
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (gst_buffer_get_size(buffer) == 0 && interval->end - interval->start > max_pause &&
      state_->has_framerate()) {
    if (!processed_)
      warn_of_pause_(
          element(),
          {GST_STREAM_ERROR_FAILED,
           "The events pause for more than a minute; skipping the pictures of pauses."},
          "pause of " + std::to_string((interval->end - interval->start) / GST_SECOND) + " s");
    interval->end = interval->start + shown_pause;
  }
  advance_to(buffer, *interval);
  if (times_ && interval->start >= times_->events().end) return push_next_picture();
  std::optional<GstClockTime> due;
  if (times_) due = times_->events().end;
  bool all = false;
  {
    const MappedEvents mapped(buffer);
    if (!mapped) {
      warn(event_fault(buffer), buffer);
      drop_buffer();
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
    all = add_events(mapped, *interval, due, buffer);
  }
  known_ = std::max(known_, interval->end);
  if (due && (!all || interval->end + event_resolution > *due)) return push_next_picture();
  drop_buffer();
  const bool is_instant = gst_buffer_get_size(buffer) == 0 && interval->end == interval->start;
  if (state_->has_framerate() || is_instant || interval->end <= segment_of(main_pad()).start)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  return push_picture(*interval, *interval);
}

/// Starts the first picture now, because the live source has not sent events.
void EventPictures::begin_now() {
  const GstSegment segment = segment_of(main_pad());
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element()));
  const guint64 position = gst_segment_position_from_running_time(&segment, GST_FORMAT_TIME, now);
  if (!GST_CLOCK_TIME_IS_VALID(position) || !state_->has_framerate()) return;
  GST_DEBUG_OBJECT(element(), "no events yet: first picture at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(position));
  begin_pictures(position);
}

GstFlowReturn EventPictures::aggregate(bool timed_out) {
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

GstClockTime EventPictures::next_time() {
  if (!state_) return GST_CLOCK_TIME_NONE;
  if (times_)
    return running_time(main_pad(), times_->picture().start).value_or(GST_CLOCK_TIME_NONE);
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element()));
  if (!waiting_since_ && GST_CLOCK_TIME_IS_VALID(now)) waiting_since_ = now;
  return waiting_since_ ? *waiting_since_ + max_wait : GST_CLOCK_TIME_NONE;
}

void EventPictures::skip(const EventInterval& picture, GstClockTime running_time,
                         GstClockTimeDiff lateness) {
  discontinuous_ = true;
  GST_DEBUG_OBJECT(element(), "downstream is late: skipped the picture at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(picture.start));
  const GstSegment segment = segment_of(main_pad());
  const GstClockTime stream_time =
      gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, picture.start);
  gst_element_post_message(GST_ELEMENT(element()), qos.skip(GST_ELEMENT(element()), picture,
                                                            running_time, stream_time, lateness));
}

GstFlowReturn EventPictures::draw(const EventInterval& events, GstBuffer* buffer) {
  state_->renderer.configure(render_settings());
  const VideoFrame frame(*state_->video, buffer, GST_MAP_WRITE);
  if (!frame) {
    post_message(element(), GST_MESSAGE_ERROR, cannot_draw(frame.fault()), frame.fault());
    return GST_FLOW_ERROR;
  }
  state_->renderer.draw(window_start(events), microseconds(events.end),
                        pixel_layout_of(*state_->video), frame.data(), frame.stride());
  return GST_FLOW_OK;
}

GstFlowReturn EventPictures::acquire_buffer(GstBuffer** buffer) {
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

/// Draws the state at the end of an interval and pushes it.
GstFlowReturn EventPictures::push_picture(const EventInterval& events,
                                          const EventInterval& picture) {
  const auto time = running_time(main_pad(), picture.start);
  if (const auto lateness = qos.lateness(time)) {
    skip(picture, *time, *lateness);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  qos.count_drawn();
  GstBuffer* acquired = nullptr;
  GstFlowReturn result = acquire_buffer(&acquired);
  if (result != GST_FLOW_OK) return result;
  OwnedBuffer buffer(acquired);
  result = draw(events, acquired);
  if (result != GST_FLOW_OK) return result;
  stamp(acquired, picture, discontinuous_);
  GST_LOG_OBJECT(element(),
                 "picture at %" GST_TIME_FORMAT " of the events from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 GST_TIME_ARGS(picture.start), GST_TIME_ARGS(events.start),
                 GST_TIME_ARGS(events.end));
  return push(std::move(buffer));
}

GstFlowReturn EventPictures::push_next_picture() {
  const EventInterval events = times_->events();
  const EventInterval picture = times_->picture();
  const GstSegment segment = segment_of(main_pad());
  if (GST_CLOCK_TIME_IS_VALID(segment.stop) && picture.start >= segment.stop) return GST_FLOW_EOS;
  times_->next();
  return push_picture(events, picture);
}

/// True if there is input for the next picture.
bool EventPictures::has_begun_picture() const {
  return state_ && state_->video && times_ && known_ > times_->events().start + event_resolution;
}

/// Pushes the incomplete last picture before a change.
void EventPictures::drain() {
  if (has_begun_picture()) push_next_picture();
}

GstFlowReturn EventPictures::choose_caps(GstCaps* downstream, GstCaps** result) const {
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
                    ("downstream accepts %" GST_PTR_FORMAT, downstream));
  return GST_FLOW_NOT_NEGOTIATED;
}

bool EventPictures::set_video(const GstCaps* caps) {
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

bool EventPictures::handle_caps(GstAggregatorPad*, GstCaps* caps) {
  const auto sensor = sensor_of(caps);
  if (!sensor) return false;
  if (state_ && state_->sensor == *sensor) return true;
  drain();
  state_.reset();  // before allocating the next: pictures can be large
  state_.emplace(State{*sensor, Renderer(sensor->width, sensor->height, render_settings())});
  gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(element()));
  return true;
}

void EventPictures::handle_segment(const GstSegment& segment) {
  if (continues(segment_of(main_pad()), segment)) return;
  drain();
  start_over();
}

/// Forgets all events, because the next input is discontinuous.
void EventPictures::start_over() {
  if (state_) state_->renderer.reset();
  discontinuous_ |= times_.has_value();
  times_.reset();
  processed_.reset();
  known_ = 0;
  waiting_since_.reset();
}

void EventPictures::flush() {
  qos.start_over();
  start_over();
}

void EventPictures::stop() {
  state_.reset();
  flush();
  discontinuous_ = false;
  warn_of_pause_.reset();
  qos.reset_counts();
}

namespace {

/// Consumes QoS events, because upstream would skip events.
gboolean src_event(GstAggregator* element, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_QOS)
    return GST_AGGREGATOR_CLASS(g_type_class_peek(GST_TYPE_EVENT_AGGREGATOR))
        ->src_event(element, event);
  aggregator_impl<EventPictures>(element).qos.handle_event(event);
  gst_event_unref(event);
  return TRUE;
}

GstCaps* fixate_src_caps(GstAggregator*, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, 0), "framerate", 30, 1);
  return gst_caps_fixate(caps);
}

gboolean decide_allocation(GstAggregator*, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  return decide_on_drawn_pool(query, caps);
}

}  // namespace

void init_pictures_class(GstEventAggregatorClass* klass, const char* formats) {
  add_aggregator_pad_template(klass, "sink", GST_PAD_SINK, EVENT_CAPS);
  const std::string video =
      std::string("video/x-raw, format = (string) ") + formats +
      ", " SIZE_CAPS ", framerate = (fraction) [ 0, max ], pixel-aspect-ratio = (fraction) 1/1";
  add_aggregator_pad_template(klass, "src", GST_PAD_SRC, video.c_str());

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->src_event = src_event;
  aggregator_class->fixate_src_caps = fixate_src_caps;
  aggregator_class->decide_allocation = decide_allocation;
  aggregator_class->update_src_caps = [](GstAggregator* element, GstCaps* caps, GstCaps** result) {
    return aggregator_impl<EventPictures>(element).choose_caps(caps, result);
  };
  aggregator_class->negotiated_src_caps = [](GstAggregator* element, GstCaps* caps) -> gboolean {
    return aggregator_impl<EventPictures>(element).set_video(caps);
  };
}
