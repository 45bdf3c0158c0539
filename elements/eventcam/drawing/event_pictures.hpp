// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <mutex>
#include <optional>

#include "elements/eventcam/drawing/frame_times.hpp"
#include "gst/aggregator/eventaggregator.hpp"
#include "src/render/renderer.hpp"

/// Quality of service of drawn pictures: predicts which ones sinks would drop, and counts them.
class PictureQos {
 public:
  /// Handles a QoS event from downstream, in any thread.
  void handle_event(GstEvent* event) {
    GstQOSType type = GST_QOS_TYPE_UNDERFLOW;
    GstClockTimeDiff late = 0;
    GstClockTime time = GST_CLOCK_TIME_NONE;
    gst_event_parse_qos(event, &type, nullptr, &late, &time);
    // Twice as late, to catch up; a throttle states the time between pictures.
    const GstClockTime factor = type == GST_QOS_TYPE_THROTTLE ? 1 : 2;
    const std::lock_guard lock(mutex_);
    if (GST_CLOCK_TIME_IS_VALID(time))
      earliest_ = late > 0 ? time + factor * static_cast<GstClockTime>(late) : 0;
  }

  /// Time by which a picture is too late; none if it is in time or has no running time.
  std::optional<GstClockTimeDiff> lateness(std::optional<GstClockTime> running_time) {
    const std::lock_guard lock(mutex_);
    if (!running_time || *running_time >= earliest_) return std::nullopt;
    return GST_CLOCK_DIFF(*running_time, earliest_);
  }

  void count_drawn() { ++drawn_; }

  /// Counts a late picture as skipped. Returns a message that reports it.
  GstMessage* skip(GstElement* element, const EventInterval& picture, GstClockTime running_time,
                   GstClockTime stream_time, GstClockTimeDiff lateness) {
    ++skipped_;
    GstMessage* const message =
        gst_message_new_qos(GST_OBJECT(element), FALSE, running_time, stream_time, picture.start,
                            picture.end - picture.start);
    gst_message_set_qos_values(message, lateness, 1, 1'000'000);
    gst_message_set_qos_stats(message, GST_FORMAT_BUFFERS, drawn_, skipped_);
    return message;
  }

  /// Treats no picture as late until the next QoS event.
  void start_over() {
    const std::lock_guard lock(mutex_);
    earliest_ = 0;
  }
  void reset_counts() { drawn_ = skipped_ = 0; }

 private:
  std::mutex mutex_;           ///< guards earliest_; make no calls while holding it
  GstClockTime earliest_ = 0;  ///< running time before which pictures are too late
  guint64 drawn_ = 0;
  guint64 skipped_ = 0;
};

/// Video of an event stream, at the framerate that downstream requests. A subclass chooses what the
/// pictures show.
class EventPictures : public EventAggregator {
 public:
  /// Logs in the element's category.
  EventPictures(GstAggregator* element, GstDebugCategory* category);

  void stop() override;
  void flush() override;
  void release_memory() noexcept override { state_.reset(); }
  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override;
  void handle_segment(const GstSegment& segment) override;
  GstFlowReturn aggregate(bool timed_out) override;
  GstClockTime next_time() override;

  GstFlowReturn choose_caps(GstCaps* downstream, GstCaps** result) const;
  bool set_video(const GstCaps* caps);

  PictureQos qos;

 protected:
  virtual eventcamera::RenderSettings render_settings() const = 0;
  /// Start of the window for the picture of an interval.
  virtual eventcamera::Microseconds window_start(const EventInterval& interval) const {
    return microseconds(interval.start);
  }

 private:
  /// State from caps to stop.
  struct State {
    eventcamera::SensorSize sensor;
    eventcamera::Renderer renderer;
    std::optional<GstVideoInfo> video{};  ///< output format, once negotiated

    bool has_framerate() const { return GST_VIDEO_INFO_FPS_N(&*video) > 0; }
  };

  void drain();
  void start_over();
  void advance_to(GstBuffer* buffer, const EventInterval& interval);
  bool add_events(const MappedEvents& mapped, const EventInterval& interval,
                  std::optional<GstClockTime> end, GstBuffer* buffer);
  GstFlowReturn handle_buffer(GstBuffer* buffer);
  void drop_buffer();
  void begin_pictures(GstClockTime start) {
    times_.emplace(start, *state_->video, segment_of(main_pad()).rate);
  }
  void begin_now();
  void skip(const EventInterval& picture, GstClockTime running_time, GstClockTimeDiff lateness);
  bool has_begun_picture() const;
  GstFlowReturn acquire_buffer(GstBuffer** buffer);
  GstFlowReturn draw(const EventInterval& events, GstBuffer* buffer);
  GstFlowReturn push_picture(const EventInterval& events, const EventInterval& picture);
  GstFlowReturn push_next_picture();

  GstDebugCategory* const category_;
  std::optional<State> state_;
  std::optional<FrameTimes> times_;  // interval of the next picture, once the first event is near
  std::optional<gsize> processed_;   // number of processed events of the first queued buffer
  GstClockTime known_ = 0;           // time up to which events are complete
  std::optional<GstClockTime> waiting_since_;  // for the first event; running time
  bool discontinuous_ = false;                 // the next picture is discontinuous
  WarnOnce warn_of_pause_;
};

/// For class_init: pads and functions of an element of EventPictures, in video formats `formats`.
void init_pictures_class(GstEventAggregatorClass* klass, const char* formats);
