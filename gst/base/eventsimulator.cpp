// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventsimulator.hpp"

#include <gst/video/video.h>

#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <utility>

#include "gst/base/drawn_video.hpp"
#include "gst/base/latency.hpp"
#include "gst/base/output_buffers.hpp"
#include "gst/base/output_caps.hpp"
#include "gst/base/picture_formats.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/flow/fixed_point.hpp"
#include "src/render/accumulator.hpp"

GST_DEBUG_CATEGORY_STATIC(event_simulator_debug);
#define GST_CAT_DEFAULT event_simulator_debug

using eventcamera::Accumulator;
using eventcamera::EventBuckets;
using eventcamera::LumaView;
using eventcamera::Nanoseconds;
using eventcamera::Image;
using eventcamera::Simulator;

namespace {

enum Property {
  prop_0,
  prop_positive_threshold,
  prop_negative_threshold,
  prop_interpolated_frames,
  prop_n_threads,
  prop_palette,
};

constexpr guint max_interpolated_frames = 255;
constexpr guint default_interpolated_frames = 10;

/// The latency is that of the framerate, or the longest interval seen, up to this.
constexpr GstClockTime max_latency = GST_SECOND;

/// What the application sets, copied once per buffer.
struct Settings {
  eventcamera::Settings simulation;
  GstEventCameraPalette palette = GST_EVENT_CAMERA_PALETTE_DARK;
};

/// What exists between caps and stop.
struct State {
  GstVideoInfo video;              ///< what comes in
  std::optional<Drawing> drawing;  ///< what goes out, unless events do
  std::unique_ptr<Simulator> simulator;
  Image<guint8> gathered;      ///< luma that was packed
  bool discontinuous = false;  ///< the next buffer does not follow on the last one
};

}  // namespace

struct GstEventSimulatorPrivate {
  std::mutex mutex;  // guards what follows; nothing is called under it
  Settings settings;
  GstClockTime latency = 0;

  // The streaming thread's, or nobody's while there is none.
  std::optional<State> state;
  std::optional<Nanoseconds> handed_out_until;  // where the last interval of the segment ended
  bool warned_of_times = false;
  bool warned_of_interlacing = false;
  bool backwards = false;  // the segment is one that was refused
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventSimulator, gst_event_simulator, GST_TYPE_BASE_TRANSFORM,
                                 GST_DEBUG_CATEGORY_INIT(event_simulator_debug, "eventsim", 0,
                                                         "event simulators"))
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_event_simulator_parent_class)

/* properties */

void gst_event_simulator_set_property(GObject* object, guint id, const GValue* value,
                                      GParamSpec* spec) {
  auto& settings = GST_EVENT_SIMULATOR(object)->priv->settings;
  const std::lock_guard lock(GST_EVENT_SIMULATOR(object)->priv->mutex);
  switch (id) {
    case prop_positive_threshold:
      settings.simulation.positive_threshold = g_value_get_double(value);
      break;
    case prop_negative_threshold:
      settings.simulation.negative_threshold = g_value_get_double(value);
      break;
    case prop_interpolated_frames:
      settings.simulation.interpolated_frames = static_cast<int>(g_value_get_uint(value));
      break;
    case prop_n_threads:
      settings.simulation.threads = static_cast<int>(g_value_get_uint(value));
      break;
    case prop_palette:
      settings.palette = static_cast<GstEventCameraPalette>(g_value_get_enum(value));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

void gst_event_simulator_get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  const auto& settings = GST_EVENT_SIMULATOR(object)->priv->settings;
  const std::lock_guard lock(GST_EVENT_SIMULATOR(object)->priv->mutex);
  switch (id) {
    case prop_positive_threshold:
      g_value_set_double(value, settings.simulation.positive_threshold);
      break;
    case prop_negative_threshold:
      g_value_set_double(value, settings.simulation.negative_threshold);
      break;
    case prop_interpolated_frames:
      g_value_set_uint(value, static_cast<guint>(settings.simulation.interpolated_frames));
      break;
    case prop_n_threads:
      g_value_set_uint(value, static_cast<guint>(settings.simulation.threads));
      break;
    case prop_palette:
      g_value_set_enum(value, settings.palette);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static Settings settings_of(GstEventSimulator* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->settings;
}

static constexpr auto property_flags = static_cast<GParamFlags>(
    G_PARAM_READWRITE | G_PARAM_CONSTRUCT | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);

void gst_event_simulator_class_install_thresholds(GstEventSimulatorClass* klass,
                                                  double grey_levels) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  if (object_class->set_property == nullptr) {  // GObject lets no class inherit these
    object_class->set_property = gst_event_simulator_set_property;
    object_class->get_property = gst_event_simulator_get_property;
  }
  g_object_class_install_property(
      object_class, prop_positive_threshold,
      g_param_spec_double("positive-threshold", "Positive threshold",
                          "An ON event needs a rise in brightness of more than this "
                          "(8-bit grey levels, whatever the depth of the video)",
                          0, 255, grey_levels, property_flags));
  g_object_class_install_property(
      object_class, prop_negative_threshold,
      g_param_spec_double("negative-threshold", "Negative threshold",
                          "An OFF event needs a fall in brightness of more than this "
                          "(8-bit grey levels, a magnitude, whatever the depth of the video)",
                          0, 255, grey_levels, property_flags));
}

void gst_event_simulator_class_install_interpolated_frames(GstEventSimulatorClass* klass) {
  g_object_class_install_property(
      G_OBJECT_CLASS(klass), prop_interpolated_frames,
      g_param_spec_uint("interpolated-frames", "Interpolated frames",
                        "How many frames to make between two frames of the video; events get "
                        "the times of these (no more are made than there are microseconds)",
                        0, max_interpolated_frames, default_interpolated_frames, property_flags));
}

/* time */

static GstClockTime latency_of(GstEventSimulator* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->latency;
}

/// Sinks are told when it changes.
static void set_latency(GstEventSimulator* self, GstClockTime latency) {
  {
    const std::lock_guard lock(self->priv->mutex);
    if (std::exchange(self->priv->latency, latency) == latency) return;
  }
  GST_DEBUG_OBJECT(self, "latency is now %" GST_TIME_FORMAT, GST_TIME_ARGS(latency));
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
}

/// Frames come as they come, whatever the caps say.
static void learn_latency(GstEventSimulator* self, GstClockTime interval) {
  const GstClockTime seen = MIN(interval, max_latency);
  if (seen > latency_of(self)) set_latency(self, seen);
}

/// Makes the next frame a first frame.
static void forget_frames(GstEventSimulator* self) {
  auto& state = self->priv->state;
  if (!state || !state->simulator->last_time()) return;
  state->simulator->reset();
  state->discontinuous = true;
}

/// Where time begins anew, so do intervals.
static void begin_anew(GstEventSimulator* self) {
  forget_frames(self);
  self->priv->handed_out_until.reset();
}

/// Bad times come in droves: the first is reported to the application, all to the log.
static void warn_of_times(GstEventSimulator* self, const char* what) {
  GST_WARNING_OBJECT(self, "%s", what);
  if (std::exchange(self->priv->warned_of_times, true)) return;
  GST_ELEMENT_WARNING(self, STREAM, FORMAT,
                      ("The timestamps of the video are broken: %s. No events are made across "
                       "such a place.",
                       what),
                      ("An interval needs a PTS at both ends; videorate or a parser in front of "
                       "this element can repair them."));
}

/// Whether a frame with this PTS can be taken, and readies the simulator for it.
static bool check_time(GstEventSimulator* self, GstBuffer* buffer) {
  const GstClockTime pts = GST_BUFFER_PTS(buffer);
  if (GST_BUFFER_IS_DISCONT(buffer)) begin_anew(self);
  if (!GST_CLOCK_TIME_IS_VALID(pts) || pts > G_MAXINT64) {
    warn_of_times(self, "a frame has no PTS");
    forget_frames(self);
    return false;
  }
  const auto time = static_cast<Nanoseconds>(pts);
  const auto last = self->priv->state->simulator->last_time();
  if (last && time <= *last) {
    warn_of_times(self, "a frame is not later than the one before");
    forget_frames(self);
  } else if (last && time - *last > eventcamera::max_interval) {
    warn_of_times(self, "two frames lie more than 71 minutes apart");
    forget_frames(self);
  }
  // An interval that begins with this frame would overlap the last one.
  return !(self->priv->handed_out_until && time < *self->priv->handed_out_until);
}

/* negotiation */

static GstCaps* transform_caps(GstBaseTransform*, GstPadDirection direction, GstCaps* caps,
                               GstCaps* filter) {
  GstCaps* other = direction == GST_PAD_SINK ? event_simulator_output_caps(caps)
                                             : event_simulator_input_caps(caps);
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

/// Fields of two moments in one frame: reported once.
static void warn_of_interlacing(GstEventSimulator* self, GstBuffer* frame) {
  const auto mode = GST_VIDEO_INFO_INTERLACE_MODE(&self->priv->state->video);
  if (mode == GST_VIDEO_INTERLACE_MODE_PROGRESSIVE ||
      (mode == GST_VIDEO_INTERLACE_MODE_MIXED &&
       !GST_BUFFER_FLAG_IS_SET(frame, GST_VIDEO_BUFFER_FLAG_INTERLACED)) ||
      std::exchange(self->priv->warned_of_interlacing, true))
    return;
  GST_ELEMENT_WARNING(self, STREAM, FORMAT,
                      ("The video is interlaced: every moving edge will fire line by line. Put a "
                       "deinterlace element in front."),
                      (nullptr));
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps* out) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  auto& state = self->priv->state;
  GstVideoInfo video;
  GstVideoInfo drawn;
  if (!gst_video_info_from_caps(&video, in) ||
      (event_simulator_draws(out) && !gst_video_info_from_caps(&drawn, out))) {
    GST_ERROR_OBJECT(self, "cannot make %" GST_PTR_FORMAT " of %" GST_PTR_FORMAT, out, in);
    return FALSE;
  }
  const auto luma = luma_format_of(video);
  try {
    if (!state || luma_format_of(state->video) != luma) {
      const bool follows = state && (state->discontinuous || state->simulator->last_time());
      state.reset();  // before the next is made: frames can be large
      state.emplace(State{.video = video,
                          .drawing = std::nullopt,
                          .simulator = GST_EVENT_SIMULATOR_GET_CLASS(self)->create(self, luma),
                          .gathered = {},
                          .discontinuous = follows});
    }
    state->video = video;
    state->drawing.reset();
    if (event_simulator_draws(out))
      state->drawing = Drawing{drawn, Accumulator(luma.width, luma.height)};
    state->gathered =
        has_packed_luma(video) ? Image<guint8>(luma.width, luma.height) : Image<guint8>();
  } catch (const std::exception& error) {
    state.reset();
    GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                      ("There is not enough memory for frames of %dx%d.", luma.width, luma.height),
                      ("%s", error.what()));
    return FALSE;
  }
  if (GST_VIDEO_INFO_FPS_N(&video) > 0)
    set_latency(self, gst_util_uint64_scale_int(GST_SECOND, GST_VIDEO_INFO_FPS_D(&video),
                                                GST_VIDEO_INFO_FPS_N(&video)));
  return TRUE;
}

/// Whether there is a state to work with. An error drops it whole, while the pads keep their caps:
/// where the application goes on all the same, these make a new one.
static bool is_ready(GstEventSimulator* self) {
  if (self->priv->state) return true;
  auto* transform = GST_BASE_TRANSFORM(self);
  GstCaps* in = gst_pad_get_current_caps(GST_BASE_TRANSFORM_SINK_PAD(transform));
  GstCaps* out = gst_pad_get_current_caps(GST_BASE_TRANSFORM_SRC_PAD(transform));
  const bool ready = in != nullptr && out != nullptr && set_caps(transform, in, out);
  gst_clear_caps(&in);
  gst_clear_caps(&out);
  return ready;
}

/* frames in, intervals out */

/// The events between the last frame and this one, or nullptr for a first frame. May throw.
static const EventBuckets* simulate(GstEventSimulator* self, const VideoFrame& frame,
                                    Nanoseconds time, const Settings& settings) {
  auto& state = *self->priv->state;
  LumaView luma{luma_format_of(state.video), frame.first_component(), frame.stride()};
  if (has_packed_luma(state.video)) {
    eventcamera::unpack_luma(static_cast<const guint8*>(luma.data), luma.stride, state.gathered);
    luma.data = state.gathered.row(0);
    luma.stride = state.gathered.stride();
  }
  if (const auto configure = GST_EVENT_SIMULATOR_GET_CLASS(self)->configure)
    configure(self, *state.simulator);
  return state.simulator->push(luma, time, settings.simulation);
}

/// Says downstream that nothing happens in an interval.
static GstFlowReturn push_gap(GstEventSimulator* self, Nanoseconds start, Nanoseconds end,
                              guint32 seqnum) {
  GstPad* pad = GST_BASE_TRANSFORM_SRC_PAD(self);
  GstEvent* gap =
      gst_event_new_gap(static_cast<GstClockTime>(start), static_cast<GstClockTime>(end - start));
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(gap, seqnum);
  return gst_pad_push_event(pad, gap) ? GST_FLOW_OK : gst_pad_get_last_flow_return(pad);
}

/// Makes a buffer that of an interval.
static void set_times(GstBuffer* out, Nanoseconds start, Nanoseconds end, State& state) {
  GST_BUFFER_PTS(out) = static_cast<GstClockTime>(start);
  GST_BUFFER_DTS(out) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(out) = static_cast<GstClockTime>(end - start);
  if (std::exchange(state.discontinuous, false)) GST_BUFFER_FLAG_SET(out, GST_BUFFER_FLAG_DISCONT);
}

/// Takes a frame and hands out the interval that it ends, if it ends one.
static GstFlowReturn take_frame(GstEventSimulator* self, GstBuffer* in, GstBuffer** out) {
  auto* transform = GST_BASE_TRANSFORM(self);
  auto& state = *self->priv->state;
  const Settings settings = settings_of(self);

  warn_of_interlacing(self, in);
  if (!check_time(self, in)) return GST_FLOW_OK;
  const auto end = static_cast<Nanoseconds>(GST_BUFFER_PTS(in));
  const auto start = state.simulator->last_time();
  const VideoFrame frame(state.video, in, GST_MAP_READ);
  if (!frame) {
    GST_ELEMENT_ERROR(self, RESOURCE, FAILED,
                      ("A buffer could not be read as video of the negotiated format."), (nullptr));
    return GST_FLOW_ERROR;
  }
  const EventBuckets* events = simulate(self, frame, end, settings);
  if (events == nullptr) return GST_FLOW_OK;
  learn_latency(self, static_cast<GstClockTime>(end - *start));
  GST_LOG_OBJECT(self,
                 "%" G_GSIZE_FORMAT " events in the interval from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 events->size(), GST_TIME_ARGS(static_cast<GstClockTime>(*start)),
                 GST_TIME_ARGS(static_cast<GstClockTime>(end)));

  self->priv->handed_out_until = end;
  GstFlowReturn result = GST_FLOW_OK;
  if (state.drawing) {
    result = event_simulator_draw_events(transform, *events, *state.drawing,
                                         eventcamera::palette(palette_name_of(settings.palette)),
                                         state.simulator->threads(), in, out);
  } else if (events->size() > 0) {
    result = event_simulator_write_events(transform, *events, state.simulator->threads(), in, out);
  } else {
    return push_gap(self, *start, end, GST_SEQNUM_INVALID);
  }
  if (result != GST_FLOW_OK) return result;
  set_times(*out, *start, end, state);
  return GST_FLOW_OK;
}

static void fail_for_want_of_memory(GstEventSimulator* self) {
  self->priv->state.reset();
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                    ("There is not enough memory for the events of a frame. Raise the "
                     "thresholds, or lower interpolated-frames."),
                    (nullptr));
}

static GstFlowReturn generate_output(GstBaseTransform* transform, GstBuffer** out) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  *out = nullptr;
  GstBuffer* in = std::exchange(transform->queued_buf, nullptr);
  if (in == nullptr) return GST_FLOW_OK;
  GstFlowReturn result = GST_FLOW_ERROR;
  if (!is_ready(self)) {
    result = GST_FLOW_NOT_NEGOTIATED;
  } else {
    try {
      result = take_frame(self, in, out);
    } catch (const std::bad_alloc&) {
      fail_for_want_of_memory(self);
    } catch (const std::exception& error) {
      self->priv->state.reset();
      GST_ELEMENT_ERROR(self, STREAM, FAILED, ("The simulation failed."), ("%s", error.what()));
    }
  }
  gst_buffer_unref(in);
  return result;
}

/* events, queries, states */

static bool take_segment(GstEventSimulator* self, GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  if (segment->rate < 0) {
    if (std::exchange(self->priv->backwards, true)) return false;  // sent again, and still refused
    GST_ELEMENT_ERROR(self, STREAM, FAILED, ("Events cannot be simulated backwards."),
                      ("The segment has rate %g; play with a positive rate.", segment->rate));
    return false;
  }
  self->priv->backwards = false;
  const GstSegment& current = GST_BASE_TRANSFORM(self)->segment;
  if (current.format != segment->format || current.rate != segment->rate ||
      current.base != segment->base || current.start != segment->start ||
      current.time != segment->time)
    begin_anew(self);
  return true;
}

/// Lets the last frame stand until `end` and sends what fires meanwhile. Where that is nothing, or
/// pictures are wanted, of which a gap has none, it is a gap downstream too.
static void hold_until(GstEventSimulator* self, Nanoseconds end, guint32 seqnum) {
  auto* transform = GST_BASE_TRANSFORM(self);
  auto& state = *self->priv->state;
  const Nanoseconds start = *state.simulator->last_time();
  if (const auto configure = GST_EVENT_SIMULATOR_GET_CLASS(self)->configure)
    configure(self, *state.simulator);
  const EventBuckets* events = state.simulator->hold_until(end, settings_of(self).simulation);
  self->priv->handed_out_until = end;
  GstBuffer* out = nullptr;
  if (events != nullptr && events->size() > 0 && !state.drawing) {
    const std::unique_ptr<GstBuffer, void (*)(GstBuffer*)> in(gst_buffer_new(), gst_buffer_unref);
    if (event_simulator_write_events(transform, *events, state.simulator->threads(), in.get(),
                                     &out) != GST_FLOW_OK)
      return;
    set_times(out, start, end, state);
    gst_pad_push(GST_BASE_TRANSFORM_SRC_PAD(transform), out);
  } else {
    push_gap(self, start, end, seqnum);
  }
}

/// Upstream has no frames for a while: the last one stands until a frame's length before the end of
/// it, where the next interval can begin. Tells whether the event is to be sent on.
static bool take_gap(GstEventSimulator* self, GstEvent* event) {
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  auto& state = self->priv->state;
  const auto start = state ? state->simulator->last_time() : std::nullopt;
  if (!start) return true;
  const GstClockTime frame = latency_of(self);
  const GstClockTime rest =
      GST_CLOCK_TIME_IS_VALID(duration) && duration > frame ? duration - frame : 0;
  if (pts > G_MAXINT64 || rest > G_MAXINT64 - pts) return false;
  const auto end = static_cast<Nanoseconds>(pts + rest);
  if (end <= *start) return false;
  try {
    hold_until(self, end, gst_event_get_seqnum(event));
  } catch (const std::bad_alloc&) {
    fail_for_want_of_memory(self);
  }
  return false;
}

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_SEGMENT:
      if (!take_segment(self, event)) {
        gst_event_unref(event);
        return FALSE;
      }
      break;
    case GST_EVENT_GAP:
      if (!take_gap(self, event)) {
        gst_event_unref(event);
        return TRUE;
      }
      break;
    case GST_EVENT_STREAM_START:
    case GST_EVENT_FLUSH_STOP:
      begin_anew(self);
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

static gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    // Upstream would leave frames out, and the events would hang on how busy the machine is.
    gst_event_unref(event);
    return TRUE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) {
    gdouble rate = 1;
    gst_event_parse_seek(event, &rate, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr);
    if (rate < 0) {
      GST_WARNING_OBJECT(transform,
                         "refused to seek at rate %g: events cannot be simulated "
                         "backwards",
                         rate);
      gst_event_unref(event);
      return FALSE;
    }
  }
  return PARENT_TRANSFORM_CLASS->src_event(transform, event);
}

static gboolean query(GstBaseTransform* transform, GstPadDirection direction, GstQuery* query) {
  if (direction != GST_PAD_SRC || GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
    return PARENT_TRANSFORM_CLASS->query(transform, direction, query);

  return answer_latency(GST_BASE_TRANSFORM_SINK_PAD(transform), query,
                        latency_of(GST_EVENT_SIMULATOR(transform)));
}

static gboolean stop(GstBaseTransform* transform) {
  auto* self = GST_EVENT_SIMULATOR(transform);
  self->priv->state.reset();
  self->priv->handed_out_until.reset();
  self->priv->warned_of_times = false;
  self->priv->warned_of_interlacing = false;
  self->priv->backwards = false;
  const std::lock_guard lock(self->priv->mutex);
  self->priv->latency = 0;
  return TRUE;
}

/* type */

static void finalize(GObject* object) {
  delete GST_EVENT_SIMULATOR(object)->priv;
  G_OBJECT_CLASS(gst_event_simulator_parent_class)->finalize(object);
}

static void gst_event_simulator_init(GstEventSimulator* self) {
  self->priv = new GstEventSimulatorPrivate();
  // Frames that are late are simulated all the same: leaving one out would change the events.
  gst_base_transform_set_qos_enabled(GST_BASE_TRANSFORM(self), FALSE);
}

static void gst_event_simulator_class_init(GstEventSimulatorClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = gst_event_simulator_set_property;
  object_class->get_property = gst_event_simulator_get_property;
  object_class->finalize = finalize;
  g_object_class_install_property(
      object_class, prop_n_threads,
      g_param_spec_uint("n-threads", "Threads",
                        "The most threads to use for one frame (0 = one for each processor); the "
                        "events are the same for any number",
                        0, G_MAXINT, 0, property_flags));
  g_object_class_install_property(
      object_class, prop_palette,
      g_param_spec_enum("palette", "Palette", "The colours of accumulated-event video",
                        GST_TYPE_EVENT_CAMERA_PALETTE, GST_EVENT_CAMERA_PALETTE_DARK,
                        property_flags));

  static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
      "sink", GST_PAD_SINK, GST_PAD_ALWAYS,
      GST_STATIC_CAPS("video/x-raw, format = (string) " EVENT_SIMULATOR_INPUT_FORMATS
                      ", width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ], "
                      "framerate = (fraction) [ 0, max ]"));
  static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
      "src", GST_PAD_SRC, GST_PAD_ALWAYS,
      GST_STATIC_CAPS(GST_EVENT_CAMERA_MEDIA_TYPE
                      ", format = (string) XYTP, width = (int) [ 1, 16384 ], "
                      "height = (int) [ 1, 16384 ], framerate = (fraction) [ 0, max ]; "
                      "video/x-raw, format = (string) " DRAWN_VIDEO_FORMATS
                      ", width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ], "
                      "framerate = (fraction) [ 0, max ]"));
  static_assert(eventcamera::max_side == 16384);
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &sink_template);
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &src_template);

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = transform_caps;
  transform_class->fixate_caps = fixate_caps;
  transform_class->set_caps = set_caps;
  event_simulator_class_install_buffers(transform_class);
  transform_class->generate_output = generate_output;
  transform_class->sink_event = sink_event;
  transform_class->src_event = src_event;
  transform_class->query = query;
  transform_class->stop = stop;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_SIMULATOR, static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_CAMERA_PALETTE, static_cast<GstPluginAPIFlags>(0));
}
