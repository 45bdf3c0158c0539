// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/eventsimulator.hpp"

#include <gst/video/video.h>

#include <array>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "gst/base/authors.hpp"
#include "gst/base/errors.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/latency.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/played_segment.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/base/types.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/simulator/buffers.hpp"
#include "gst/simulator/caps.hpp"
#include "gst/simulator/class_images.hpp"
#include "gst/simulator/continuation.hpp"
#include "gst/simulator/flow_tensor.hpp"
#include "gst/simulator/frame_clock.hpp"
#include "gst/simulator/frame_timing.hpp"
#include "gst/simulator/properties.hpp"

GST_DEBUG_CATEGORY_STATIC(event_simulator_debug);
#define GST_CAT_DEFAULT event_simulator_debug

using eventcamera::EventBuckets;
using eventcamera::IntervalSimulator;
using eventcamera::Nanoseconds;

namespace {

/// State from caps to stop.
struct State {
  GstVideoInfo video;  ///< input format
  std::unique_ptr<VideoSimulator> frames;
  bool draws = false;  ///< the output is video, not events

  IntervalSimulator& simulator() const { return frames->simulator(); }
};

/// State from start to stop, independent of caps.
struct Stream {
  std::optional<Nanoseconds> handed_out_until;  ///< end of the last interval of the segment
  bool discontinuous = false;                   ///< the next buffer is discontinuous
  Continuation continuation;
  GstFlowReturn flow = GST_FLOW_OK;  ///< result of the last push
  FrameClock clock{GST_CAT_DEFAULT};
  WarnOnce warn_of_times{GST_CAT_DEFAULT};
  WarnOnce warn_of_interlacing{GST_CAT_DEFAULT};
  WarnOnce warn_of_drawn_input{GST_CAT_DEFAULT};
};

}  // namespace

struct GstEventSimulatorPrivate {
  explicit GstEventSimulatorPrivate(GstEventSimulator* self)
      : timing(GST_BASE_TRANSFORM(self), GST_CAT_DEFAULT) {}

  Guarded<SimulatorSettings> settings;
  std::shared_ptr<void> method_settings;

  FrameTiming timing;
  ClassImages class_images{GST_CAT_DEFAULT};
  FlowTensors flow_tensors{GST_CAT_DEFAULT};

  // Accessed with the stream lock of the sink pad, or while there is no streaming thread.
  std::optional<State> state;
  Stream stream;
};

static gpointer parent_class;
static gint private_offset;
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(parent_class)

static GstEventSimulatorPrivate& priv_of(GstEventSimulator* self) {
  return *static_cast<GstEventSimulatorPrivate*>(G_STRUCT_MEMBER_P(self, private_offset));
}

static const EventSimulatorMethod& method_of(GstEventSimulator* self) {
  return *GST_EVENT_SIMULATOR_GET_CLASS(self)->method;
}

void* event_simulator_settings(GObject* object) {
  return priv_of(GST_EVENT_SIMULATOR(object)).method_settings.get();
}

static std::array<CompanionPad*, 2> companions_of(GstEventSimulator* self) {
  return {&priv_of(self).class_images, &priv_of(self).flow_tensors};
}

/// Passes the settings of the method to the simulator.
static void configure(GstEventSimulator* self) {
  if (const auto configure = method_of(self).configure)
    configure(priv_of(self).state->simulator(), G_OBJECT(self));
}

Guarded<SimulatorSettings>& simulator_settings_of(GObject* object) {
  return priv_of(GST_EVENT_SIMULATOR(object)).settings;
}

Guarded<SimulatorQos>& simulator_qos_of(GObject* object) {
  return priv_of(GST_EVENT_SIMULATOR(object)).timing.qos();
}

/* intervals out */

/// Pushes a GAP for an interval without events.
static GstFlowReturn push_gap(GstEventSimulator* self, Nanoseconds start, Nanoseconds end,
                              guint32 seqnum) {
  GstEvent* gap =
      gst_event_new_gap(static_cast<GstClockTime>(start), static_cast<GstClockTime>(end - start));
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(gap, seqnum);
  return push_event(GST_BASE_TRANSFORM_SRC_PAD(self), gap);
}

/// Sets the timestamps and flags of an output buffer, and pushes it.
static GstFlowReturn push_buffer(GstEventSimulator* self, OwnedBuffer out, GstClockTime pts,
                                 GstClockTime duration) {
  auto* transform = GST_BASE_TRANSFORM(self);
  GST_BUFFER_PTS(out.get()) = pts;
  GST_BUFFER_DTS(out.get()) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(out.get()) = duration;
  if (std::exchange(priv_of(self).stream.discontinuous, false))
    GST_BUFFER_FLAG_SET(out.get(), GST_BUFFER_FLAG_DISCONT);
  if (transform->segment.format == GST_FORMAT_TIME)
    transform->segment.position = GST_CLOCK_TIME_IS_VALID(duration) ? pts + duration : pts;
  return gst_pad_push(GST_BASE_TRANSFORM_SRC_PAD(transform), out.release());
}

/// Writes the events of an interval, and their labels, to a new buffer. `frame` ends it. May throw.
static GstFlowReturn write_events(GstEventSimulator* self, const EventBuckets& events,
                                  GstBuffer* frame, Nanoseconds start, Nanoseconds end,
                                  OwnedBuffer& out) {
  auto* transform = GST_BASE_TRANSFORM(self);
  auto& priv = priv_of(self);
  auto& simulator = priv.state->simulator();
  const GstFlowReturn result =
      event_simulator_write_events(transform, events, simulator, frame, out);
  if (result != GST_FLOW_OK || !simulator.has_labels()) return result;
  GST_BUFFER_PTS(out.get()) = static_cast<GstClockTime>(start);  // without it, none can be mapped
  return priv.class_images.set_classes(out.get(), transform->segment, priv.state->video, start,
                                       end);
}

void event_simulator_push_interval(GObject* element, Interval interval,
                                   const EventBuckets* events) {
  auto* self = GST_EVENT_SIMULATOR(element);
  auto& timing = priv_of(self).timing;
  auto& [frame, start, end, began] = interval;
  if (events == nullptr) {
    timing.end_work(end, began);
    timing.end();
    return;
  }
  GST_LOG_OBJECT(self,
                 "%" G_GSIZE_FORMAT " events in the interval from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 events->size(), GST_TIME_ARGS(static_cast<GstClockTime>(start)),
                 GST_TIME_ARGS(static_cast<GstClockTime>(end)));

  auto& flow = priv_of(self).stream.flow;
  OwnedBuffer out;
  if (events->size() > 0) flow = write_events(self, *events, frame.get(), start, end, out);
  frame.reset();  // upstream may need it while downstream blocks
  timing.end_work(end, began);
  timing.add_interval(start, end);
  if (events->size() == 0)
    flow = push_gap(self, start, end, GST_SEQNUM_INVALID);
  else if (flow == GST_FLOW_OK)
    flow = push_buffer(self, std::move(out), static_cast<GstClockTime>(start),
                       static_cast<GstClockTime>(end - start));
  timing.end();
}

/* discontinuities */

/// Makes the next frame a first frame. May throw.
static void forget_frames(GstEventSimulator* self) {
  auto& state = priv_of(self).state;
  if (!state) return;
  state->frames->finish();
  if (!state->simulator().last_time()) return;
  GST_DEBUG_OBJECT(self, "the next frame begins an interval; the last was at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(static_cast<GstClockTime>(*state->simulator().last_time())));
  state->simulator().reset();
  priv_of(self).stream.discontinuous = true;
}

/// Restarts at a first frame, for a new timeline. May throw.
static void start_over(GstEventSimulator* self) {
  forget_frames(self);
  priv_of(self).stream.handed_out_until.reset();
}

static void warn_of_times(GstEventSimulator* self, const char* what) {
  priv_of(self).stream.warn_of_times(
      self,
      {GST_STREAM_ERROR_FORMAT, std::string("Bad video timestamps: ") + what +
                                    ". No events are simulated across this point; videorate or a "
                                    "parser upstream can repair timestamps."},
      "an interval needs a PTS at both ends");
}

/// Takes the time of a frame: forgets the frames that it does not continue. False if the frame must
/// be skipped. May throw.
static bool accept_time(GstEventSimulator* self, GstBuffer* buffer) {
  const GstClockTime pts = GST_BUFFER_PTS(buffer);
  const bool continues = priv_of(self).stream.continuation.continues();
  if (GST_BUFFER_IS_DISCONT(buffer) && !continues) {
    start_over(self);
    priv_of(self).stream.discontinuous = true;
  }
  if (pts > G_MAXINT64) {
    warn_of_times(self, "the PTS of a frame is out of range");
    forget_frames(self);
    return false;
  }
  const auto time = static_cast<Nanoseconds>(pts);
  const auto last = priv_of(self).state->simulator().last_time();
  if (last && time <= *last) {
    warn_of_times(self, "a frame is not later than the previous one");
    forget_frames(self);
  } else if (last && time - *last > eventcamera::max_interval) {
    warn_of_times(self, "two frames are more than 71 minutes apart");
    forget_frames(self);
  }
  // An interval starting with this frame would overlap the last one.
  const auto until = priv_of(self).stream.handed_out_until;
  if (!until || time >= *until) return true;
  GST_LOG_OBJECT(self,
                 "skipping the frame at %" GST_TIME_FORMAT ": events until %" GST_TIME_FORMAT
                 " were sent",
                 GST_TIME_ARGS(pts), GST_TIME_ARGS(static_cast<GstClockTime>(*until)));
  return false;
}

/// Runs `work`; reports any exception and drops the state, because the simulator is then unusable.
/// The next output, if any, is discontinuous.
template <class Work>
static void reported(GstEventSimulator* self, const Work& work) {
  const auto failure = [&](const std::exception& error) -> Report {
    priv_of(self).state.reset();
    priv_of(self).stream.discontinuous = true;
    if (is_a<std::bad_alloc>(error))
      return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
              "Not enough memory for the events of a frame. Raise the thresholds, or lower "
              "interpolated-frames."};
    if (const auto* known = dynamic_cast<const VideoSimulatorError*>(&error))
      return known->report();
    return {GST_STREAM_ERROR_FAILED, "The simulation failed."};
  };
  if (!guarded(self, failure, work)) priv_of(self).stream.flow = GST_FLOW_ERROR;
}

/// Finishes and pushes all pending intervals.
static void finish_intervals(GstEventSimulator* self) {
  if (const auto& state = priv_of(self).state) reported(self, [&] { state->frames->finish(); });
}

void event_simulator_push_finished(GstElement* element) {
  auto* self = GST_EVENT_SIMULATOR(element);
  GstPad* pad = GST_BASE_TRANSFORM_SINK_PAD(self);
  GST_PAD_STREAM_LOCK(pad);
  if (const auto& state = priv_of(self).state)
    reported(self, [&] { state->frames->push_finished(); });
  GST_PAD_STREAM_UNLOCK(pad);
}

/* negotiation */

static GstCaps* transform_caps(GstBaseTransform* transform, GstPadDirection direction,
                               GstCaps* caps, GstCaps* filter) {
  const SimulatorVideo& video = method_of(GST_EVENT_SIMULATOR(transform)).video;
  GstCaps* other = direction == GST_PAD_SINK ? video.output_caps(caps) : video.input_caps(caps);
  if (filter == nullptr) return other;
  GstCaps* filtered = gst_caps_intersect_full(filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(other);
  return filtered;
}

static GstCaps* fixate_caps(GstBaseTransform*, GstPadDirection direction, GstCaps*,
                            GstCaps* other) {
  if (direction == GST_PAD_SRC || gst_caps_is_empty(other)) return gst_caps_fixate(other);
  return event_simulator_fixate_output(other);
}

/// Warns about interlaced video, whose two fields are captured at different times.
static void check_interlacing(GstEventSimulator* self, GstBuffer* frame) {
  auto& priv = priv_of(self);
  const auto mode = GST_VIDEO_INFO_INTERLACE_MODE(&priv.state->video);
  if (mode == GST_VIDEO_INTERLACE_MODE_PROGRESSIVE ||
      (mode == GST_VIDEO_INTERLACE_MODE_MIXED &&
       !GST_BUFFER_FLAG_IS_SET(frame, GST_VIDEO_BUFFER_FLAG_INTERLACED)))
    return;
  priv.stream.warn_of_interlacing(
      self,
      {GST_STREAM_ERROR_FORMAT,
       "The video is interlaced: moving edges will fire in every other row. Insert a deinterlace "
       "element upstream."},
      std::string("interlace-mode=") + gst_video_interlace_mode_to_string(mode));
}

/// Warns if the video already shows drawn events, of a recording or of another simulator.
static void check_input(GstEventSimulator* self) {
  GstQuery* query = new_drawn_events_query();
  if (gst_pad_peer_query(GST_BASE_TRANSFORM_SINK_PAD(self), query))
    priv_of(self).stream.warn_of_drawn_input(
        self,
        {GST_STREAM_ERROR_FORMAT,
         "The video shows events that were drawn upstream, not a scene. A recording of events "
         "needs no simulator. To feed one video to two simulators, insert a tee before both."},
        "an element upstream answered that it draws events");
  gst_query_unref(query);
}

/// True if the events are drawn here.
static bool draws(GstBaseTransform* transform) {
  GstCaps* caps = gst_pad_get_current_caps(GST_BASE_TRANSFORM_SRC_PAD(transform));
  const bool draws = caps != nullptr && event_simulator_draws(caps);
  gst_clear_caps(&caps);
  return draws;
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps* out) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  auto& state = priv_of(self).state;
  finish_intervals(self);
  GstVideoInfo video;
  GstVideoInfo drawn;
  if (!gst_video_info_from_caps(&video, in) ||
      (event_simulator_draws(out) && !gst_video_info_from_caps(&drawn, out))) {
    GST_ERROR_OBJECT(self, "cannot make %" GST_PTR_FORMAT " from %" GST_PTR_FORMAT, out, in);
    return FALSE;
  }
  const auto luma = FrameLuma::format_of(video);
  const auto failure = [&](const std::exception& error) -> Report {
    state.reset();
    if (is_a<std::bad_alloc>(error))
      return {GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory for frames of " +
                                                    std::to_string(luma.width) + "x" +
                                                    std::to_string(luma.height) + " pixels."};
    if (const auto* known = dynamic_cast<const VideoSimulatorError*>(&error))
      return known->report();
    return {GST_STREAM_ERROR_FAILED, "Cannot simulate this video."};
  };
  const bool made = guarded(self, failure, [&] {
    if (!state || FrameLuma::format_of(state->video) != luma) {
      if (state && state->simulator().last_time()) priv_of(self).stream.discontinuous = true;
      state.reset();  // before allocating the next: frames can be large
      state.emplace(State{.video = video, .frames = method_of(self).create(G_OBJECT(self), video)});
    } else {
      state->video = video;
      state->frames->set_video(video);
    }
    state->draws = event_simulator_draws(out);
    if (state->draws) state->frames->set_drawn_video(drawn);
  });
  if (!made) return FALSE;
  GST_DEBUG_OBJECT(self, "%s of %" GST_PTR_FORMAT, state->draws ? "event frames" : "events", in);
  check_input(self);
  // Pictures have the time of their frame, intervals that of the previous frame.
  const GstClockTime duration = state->draws ? 0 : frame_duration(video);
  if (duration > 0 || state->draws) priv_of(self).timing.expect(static_cast<Nanoseconds>(duration));
  priv_of(self).timing.qos().lock()->take_output(state->draws);
  return TRUE;
}

/// Ensures that there is a state. Errors drop it while the pads keep their caps; if the application
/// continues, it is recreated from these. False if that fails.
static bool ensure_state(GstEventSimulator* self) {
  if (priv_of(self).state) return true;
  auto* transform = GST_BASE_TRANSFORM(self);
  GstCaps* in = gst_pad_get_current_caps(GST_BASE_TRANSFORM_SINK_PAD(transform));
  GstCaps* out = gst_pad_get_current_caps(GST_BASE_TRANSFORM_SRC_PAD(transform));
  const bool ready = in != nullptr && out != nullptr && set_caps(transform, in, out);
  gst_clear_caps(&in);
  gst_clear_caps(&out);
  return ready;
}

/* frames in */

/// Updates controlled properties to their values at `time`, a timestamp of the segment.
static void sync_controlled_properties(GstEventSimulator* self, GstClockTime time) {
  const GstSegment& segment = GST_BASE_TRANSFORM(self)->segment;
  if (segment.format != GST_FORMAT_TIME) return;  // e.g. from appsrc
  const auto stream_time = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, time);
  if (GST_CLOCK_TIME_IS_VALID(stream_time)) gst_object_sync_values(GST_OBJECT(self), stream_time);
}

/// Draws the events since the last frame (none for a first frame). The picture replaces the frame,
/// at its `time`. May throw.
static GstFlowReturn draw_frame(GstEventSimulator* self, const SimulatorSettings& settings,
                                Nanoseconds time, OwnedBuffer in) {
  auto* transform = GST_BASE_TRANSFORM(self);
  auto& state = *priv_of(self).state;
  auto& timing = priv_of(self).timing;
  OwnedBuffer picture;
  GstFlowReturn result = event_simulator_make_picture(transform, in.get(), picture);
  if (result == GST_FLOW_OK) {
    GST_BUFFER_DURATION(picture.get()) = GST_BUFFER_DURATION(in.get());
    state.frames->draw(std::move(in), time, settings.simulation,
                       eventcamera::palette(settings.palette), picture.get());
  }
  timing.end_work(time, timing.began());
  if (result != GST_FLOW_OK) return result;
  timing.qos().lock()->extend(transform, picture.get(), frame_duration(state.video));
  const GstClockTime duration = GST_BUFFER_DURATION(picture.get());
  result = push_buffer(self, std::move(picture), static_cast<GstClockTime>(time), duration);
  timing.end();
  return result;
}

/// Lets class images and flow follow the video up to a time, also past frames that are skipped.
/// What the interval since the last frame may need is kept.
static void advance_companions(GstEventSimulator* self, GstClockTime time) {
  const GstSegment& segment = GST_BASE_TRANSFORM(self)->segment;
  const auto& state = *priv_of(self).state;
  const auto last = state.draws ? std::nullopt : state.simulator().last_time();
  const auto from = running_time_of(
      segment, std::min(time, static_cast<GstClockTime>(last.value_or(Nanoseconds{G_MAXINT64}))));
  const auto until = running_time_of(segment, time);
  if (from && until)
    for (auto* companion : companions_of(self)) companion->advance(*from, *until);
}

/// Configures the simulator for the next interval, and returns the settings of that.
static SimulatorSettings begin_interval(GstEventSimulator* self) {
  configure(self);
  SimulatorSettings settings = priv_of(self).settings.copy();
  if (priv_of(self).class_images.pad()) settings.simulation.labels = true;
  if (priv_of(self).state->draws) settings.simulation.labels = false;
  return settings;
}

/// Restores the state that a timeline continues from, if any, before its first frame or GAP. May
/// throw.
static void restore_at_start(GstEventSimulator* self) {
  auto& continuation = priv_of(self).stream.continuation;
  auto& simulator = priv_of(self).state->simulator();
  if (!continuation.begins() || method_of(self).restore == nullptr) return;
  configure(self);
  method_of(self).restore(simulator, G_OBJECT(self));
  continuation.restored(simulator.last_time());
}

/// Processes a frame and outputs the interval that it ends, if any. May throw.
static void take_frame(GstEventSimulator* self, OwnedBuffer in) {
  auto* transform = GST_BASE_TRANSFORM(self);
  auto& priv = priv_of(self);
  auto& stream = priv.stream;
  auto& state = *priv.state;
  const GstClockTime pts = GST_BUFFER_PTS(in.get());
  sync_controlled_properties(self, pts);
  check_interlacing(self, in.get());
  restore_at_start(self);
  advance_companions(self, pts);
  if (stream.continuation.is_after(pts)) {
    GST_LOG_OBJECT(self, "skipping the frame at %" GST_TIME_FORMAT ": the state is later",
                   GST_TIME_ARGS(pts));
    return;
  }
  if (!accept_time(self, in.get())) return;
  const auto start = state.simulator().last_time();
  if (!priv.timing.begin(in.get(), start.has_value())) return;
  const auto end = static_cast<Nanoseconds>(pts);
  const SimulatorSettings settings = begin_interval(self);
  if (start && !priv.flow_tensors.give(GST_ELEMENT(self), state.simulator(), transform->segment,
                                       state.video, *start, end)) {
    stream.flow = GST_FLOW_FLUSHING;
    return;
  }
  if (state.draws) {
    stream.handed_out_until = end;
    stream.flow = draw_frame(self, settings, end, std::move(in));
    return;
  }
  if (start) stream.handed_out_until = end;
  state.frames->push({std::move(in), start.value_or(end), end, priv.timing.began()},
                     settings.simulation);
}

static GstFlowReturn generate_output(GstBaseTransform* transform, GstBuffer** out) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  auto& stream = priv_of(self).stream;
  auto& flow = stream.flow;
  *out = nullptr;  // output is pushed by the simulator, possibly later
  OwnedBuffer in(std::exchange(transform->queued_buf, nullptr));
  // Since output was pushed outside of this function, downstream may have been relinked.
  if (flow != GST_FLOW_EOS && flow != GST_FLOW_ERROR) {
    flow = GST_FLOW_OK;
    if (!ensure_state(self)) return GST_FLOW_NOT_NEGOTIATED;
    if (stream.clock.stamp(transform, priv_of(self).state->video, in))
      reported(self, [&] { take_frame(self, std::move(in)); });
  }
  return std::exchange(flow, GST_FLOW_OK);
}

/* events, queries, states */

/// Replaces a segment in another format than TIME, as from byte sources, by a TIME segment for the
/// timestamps that frames get here. Takes ownership of `event`.
static GstEvent* segment_of_times(GstEvent* event) {
  if (segment_of(event).format == GST_FORMAT_TIME) return event;
  GstSegment times;
  gst_segment_init(&times, GST_FORMAT_TIME);
  GstEvent* replacement = gst_event_new_segment(&times);
  gst_event_set_seqnum(replacement, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return replacement;
}

/// Starts a new timeline, discontinuous with the previous one.
static void start_timeline(GstEventSimulator* self) {
  auto& state = priv_of(self).state;
  if (state) state->frames->drop();
  priv_of(self).stream.flow = GST_FLOW_OK;
  reported(self, [&] { start_over(self); });
  priv_of(self).stream.continuation = {};
  for (auto* companion : companions_of(self)) companion->begin();
  priv_of(self).stream.clock.start_over();
  priv_of(self).timing.qos().lock()->start_over();
}

static void take_segment(GstEventSimulator* self, const GstSegment& segment) {
  const GstSegment& current = GST_BASE_TRANSFORM(self)->segment;
  if (current.format != segment.format || current.rate != segment.rate ||
      current.base != segment.base || current.start != segment.start ||
      current.time != segment.time)
    start_timeline(self);
}

/// Holds the last frame until `end` and pushes the events of that time, or a GAP if there are none.
/// May throw.
static void hold_until(GstEventSimulator* self, Nanoseconds end, guint32 seqnum) {
  auto& state = *priv_of(self).state;
  const Nanoseconds start = *state.simulator().last_time();
  sync_controlled_properties(self, static_cast<GstClockTime>(end));
  const EventBuckets* events = state.simulator().hold_until(end, begin_interval(self).simulation);
  priv_of(self).stream.handed_out_until = end;
  auto& flow = priv_of(self).stream.flow;
  if (events == nullptr || events->size() == 0) {
    flow = push_gap(self, start, end, seqnum);
    return;
  }
  const OwnedBuffer in(gst_buffer_new());
  OwnedBuffer out;
  flow = write_events(self, *events, in.get(), start, end, out);
  if (flow == GST_FLOW_OK)
    flow = push_buffer(self, std::move(out), static_cast<GstClockTime>(start),
                       static_cast<GstClockTime>(end - start));
}

/// Warns if a stream that continues from a state ended before it.
static void warn_of_no_progress(GstEventSimulator* self) {
  const auto& state = priv_of(self).state;
  auto& stream = priv_of(self).stream;
  const auto from = stream.continuation.time();
  if (!state || !from || state->simulator().last_time() != from) return;
  stream.warn_of_times(self,
                       {GST_STREAM_ERROR_FORMAT,
                        "No events: all frames are before the state that initial-state names. Give "
                        "them the timestamps that they have in the whole video."},
                       "the state is that at " + std::to_string(*from) + " ns");
}

/// Saves the state at the end of a stream, if the element has to.
static void save_state(GstEventSimulator* self) {
  const auto& state = priv_of(self).state;
  const auto save = method_of(self).save;
  if (save != nullptr && state && state->simulator().last_time())
    reported(self, [&] { save(state->simulator(), G_OBJECT(self)); });
}

/// Handles a GAP from upstream: holds the last frame until one frame duration before the end of the
/// gap, where the next interval begins; for drawn video, only forwards the gap. Returns true if the
/// event must be forwarded.
static bool take_gap(GstEventSimulator* self, GstEvent* event) {
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  auto& state = priv_of(self).state;
  if (!state) return true;
  reported(self, [&] { restore_at_start(self); });
  if (!state) return false;  // after an error
  const bool has_end = GST_CLOCK_TIME_IS_VALID(duration) && pts <= G_MAXINT64;
  advance_companions(self, pts + (has_end ? std::min(duration, G_MAXINT64 - pts) : 0));
  const auto start = state->simulator().last_time();
  if (!start || state->draws) return true;
  const auto frame = static_cast<GstClockTime>(priv_of(self).timing.interval());
  const GstClockTime rest =
      GST_CLOCK_TIME_IS_VALID(duration) && duration > frame ? duration - frame : 0;
  if (pts > G_MAXINT64 || rest > G_MAXINT64 - pts) return false;
  const auto end = static_cast<Nanoseconds>(pts + rest);
  if (end <= *start) return false;
  reported(self, [&] { hold_until(self, end, gst_event_get_seqnum(event)); });
  return false;
}

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  const bool is_serialized =
      (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) != 0;
  if (is_serialized && GST_EVENT_TYPE(event) != GST_EVENT_FLUSH_STOP) finish_intervals(self);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_SEGMENT:
      event = segment_of_times(event);
      if (!plays_events(self, event, "simulate")) return FALSE;
      take_segment(self, segment_of(event));
      break;
    case GST_EVENT_GAP:
      if (!take_gap(self, event)) {
        gst_event_unref(event);
        return TRUE;
      }
      break;
    case GST_EVENT_STREAM_START:
      start_timeline(self);
      break;
    case GST_EVENT_FLUSH_START:
      for (auto* companion : companions_of(self)) companion->set_flushing(true);
      break;
    case GST_EVENT_FLUSH_STOP:
      for (auto* companion : companions_of(self)) companion->set_flushing(false);
      start_timeline(self);
      break;
    case GST_EVENT_EOS:
      for (auto* companion : companions_of(self)) companion->end();
      warn_of_no_progress(self);
      save_state(self);
      break;
    case GST_EVENT_SEGMENT_DONE:
      for (auto* companion : companions_of(self)) companion->end_segment();
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

/// True if a seek can be forwarded. Class images and flow must stay with the video, so none of
/// their upstreams may refuse.
static bool can_seek(GstEventSimulator* self, const SeekRequest& request) {
  bool is_alone = true;
  bool all_would = would_seek(GST_BASE_TRANSFORM_SINK_PAD(self), request);
  for (auto* companion : companions_of(self)) {
    const OwnedPad pad = companion->pad();
    if (!pad || !gst_pad_is_linked(pad.get())) continue;
    is_alone = false;
    all_would = all_would && would_seek(pad.get(), request);
  }
  return is_alone || all_would;
}

static gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    // Not forwarded: only this element skips frames.
    priv_of(GST_EVENT_SIMULATOR(transform)).timing.qos().lock()->take_event(transform, event);
    gst_event_unref(event);
    return TRUE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) {
    const SeekRequest request(event);
    if (request.rate() < 0) {
      GST_WARNING_OBJECT(transform,
                         "refused to seek at rate %g: events cannot be simulated "
                         "backwards",
                         request.rate());
      gst_event_unref(event);
      return FALSE;
    }
    if (!can_seek(GST_EVENT_SIMULATOR(transform), request)) {
      GST_WARNING_OBJECT(transform, "an upstream would refuse: refused %" GST_PTR_FORMAT, event);
      gst_event_unref(event);
      return FALSE;
    }
    for (auto* companion : companions_of(GST_EVENT_SIMULATOR(transform)))
      if (const OwnedPad pad = companion->pad())
        gst_pad_push_event(pad.get(), gst_event_ref(event));
  }
  return PARENT_TRANSFORM_CLASS->src_event(transform, event);
}

static gboolean query(GstBaseTransform* transform, GstPadDirection direction, GstQuery* query) {
  if (direction == GST_PAD_SRC && is_drawn_events_query(query) && draws(transform)) return TRUE;
  const bool is_serialized =
      (gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED) != 0;
  if (direction == GST_PAD_SINK && is_serialized) finish_intervals(GST_EVENT_SIMULATOR(transform));
  if (direction != GST_PAD_SRC || GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
    return PARENT_TRANSFORM_CLASS->query(transform, direction, query);

  const GstClockTime latency = priv_of(GST_EVENT_SIMULATOR(transform)).timing.latency();
  return answer_latency(GST_CAT_DEFAULT, GST_BASE_TRANSFORM_SINK_PAD(transform), query, latency);
}

static GstPad* request_new_pad(GstElement* element, GstPadTemplate* pad_template, const gchar*,
                               const GstCaps*) {
  auto& priv = priv_of(GST_EVENT_SIMULATOR(element));
  const bool is_of_labels =
      g_strcmp0(GST_PAD_TEMPLATE_NAME_TEMPLATE(pad_template), "label_sink") == 0;
  if (is_of_labels) return priv.class_images.add_to(element, pad_template);
  return priv.flow_tensors.add_to(element, pad_template);
}

static void release_pad(GstElement* element, GstPad* pad) {
  for (auto* companion : companions_of(GST_EVENT_SIMULATOR(element)))
    if (companion->pad().get() == pad) companion->remove_from(element, pad);
}

/// Ends the waiting of threads before their pads are deactivated.
static GstStateChangeReturn change_state(GstElement* element, GstStateChange change) {
  for (auto* companion : companions_of(GST_EVENT_SIMULATOR(element))) {
    if (change == GST_STATE_CHANGE_READY_TO_PAUSED) companion->start();
    if (change == GST_STATE_CHANGE_PAUSED_TO_READY) companion->stop();
  }
  return GST_ELEMENT_CLASS(parent_class)->change_state(element, change);
}

static gboolean start(GstBaseTransform* transform) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  if (const auto fault_of = method_of(self).fault) {
    if (const auto fault = fault_of(G_OBJECT(self)); !fault.empty()) {
      GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", fault.c_str()), (nullptr));
      return FALSE;
    }
  }
  const auto qos = priv_of(self).timing.qos().lock();
  qos->start_over();
  qos->reset_stats();
  return TRUE;
}

static gboolean stop(GstBaseTransform* transform) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  GST_PAD_STREAM_LOCK(GST_BASE_TRANSFORM_SINK_PAD(self));  // see event_simulator_push_finished()
  priv_of(self).state.reset();
  priv_of(self).stream = {};
  priv_of(self).flow_tensors.reset();
  GST_PAD_STREAM_UNLOCK(GST_BASE_TRANSFORM_SINK_PAD(self));
  priv_of(self).timing.reset();
  return TRUE;
}

/* type */

/// Makes the method's settings here, because the method is not yet known in init.
static void constructed(GObject* object) {
  auto* self = GST_EVENT_SIMULATOR(object);
  const auto& method = method_of(self);
  if (method.threshold) {
    const auto settings = priv_of(self).settings.lock();
    settings->simulation.positive_threshold = *method.threshold;
    settings->simulation.negative_threshold = *method.threshold;
  }
  if (method.make_settings != nullptr) priv_of(self).method_settings = method.make_settings();
  G_OBJECT_CLASS(parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(GST_EVENT_SIMULATOR(object)));
  G_OBJECT_CLASS(parent_class)->finalize(object);
}

static void gst_event_simulator_init(GstEventSimulator* self) {
  std::construct_at(&priv_of(self), self);
  // SimulatorQos decides which frames are skipped.
  gst_base_transform_set_qos_enabled(GST_BASE_TRANSFORM(self), FALSE);
}

static void gst_event_simulator_class_init(GstEventSimulatorClass* klass) {
  parent_class = g_type_class_peek_parent(klass);
  g_type_class_adjust_private_offset(klass, &private_offset);
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  install_base_properties(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->request_new_pad = request_new_pad;
  element_class->release_pad = release_pad;
  element_class->change_state = change_state;

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = transform_caps;
  transform_class->fixate_caps = fixate_caps;
  transform_class->set_caps = set_caps;
  event_simulator_class_install_buffers(transform_class);
  transform_class->generate_output = generate_output;
  transform_class->sink_event = sink_event;
  transform_class->src_event = src_event;
  transform_class->query = query;
  transform_class->start = start;
  transform_class->stop = stop;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_SIMULATOR, static_cast<GstPluginAPIFlags>(0));
}

GType gst_event_simulator_get_type() {
  static const GType type = [] {
    GST_DEBUG_CATEGORY_INIT(event_simulator_debug, "eventsim", 0, "event simulators");
    const GType registered = register_type(GST_TYPE_BASE_TRANSFORM, event_simulator_type_name,
                                           gst_event_simulator_class_init, gst_event_simulator_init,
                                           G_TYPE_FLAG_ABSTRACT);
    private_offset = g_type_add_instance_private(registered, sizeof(GstEventSimulatorPrivate));
    return registered;
  }();
  return type;
}

static void method_class_init(gpointer klass, gpointer row) {
  const auto& method = *static_cast<const EventSimulatorMethod*>(row);
  auto* object_class = G_OBJECT_CLASS(klass);
  GST_EVENT_SIMULATOR_CLASS(klass)->method = &method;
  method.video.install_pads(GST_ELEMENT_CLASS(klass));
  if (method.threshold) install_thresholds(object_class, *method.threshold);
  if (method.interpolates) install_interpolated_frames(object_class);
  if (method.labels) {
    install_label(object_class);
    add_pad_template(GST_ELEMENT_CLASS(klass), "label_sink", GST_PAD_SINK, CLASS_IMAGE_CAPS,
                     GST_PAD_REQUEST);
  }
  if (method.takes_flow)
    add_pad_template(GST_ELEMENT_CLASS(klass), "flow_sink", GST_PAD_SINK, FLOW_TENSOR_CAPS,
                     GST_PAD_REQUEST);
  if (method.install_properties != nullptr) method.install_properties(object_class);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), method.long_name,
                                        "Filter/Effect/Converter/Video", method.description,
                                        EVENTSIM_AUTHORS);
}

GType event_simulator_type(const EventSimulatorMethod& method, GType parent) {
  return row_type(parent, method.type_name, method_class_init, &method);
}
