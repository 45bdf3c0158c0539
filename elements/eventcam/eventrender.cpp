// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventrender
 * @title: eventrender
 * @short_description: draws events as video
 *
 * Turns a stream of events into video, at the framerate that downstream asks for (30/1 where it
 * leaves the choice). A picture has the time of the interval that it ends: what it shows is the
 * state at PTS + duration.
 *
 * - `accumulate`: where ON, OFF or both fired within a window;
 * - `decay`: the sum of ON minus OFF, which fades exponentially;
 * - `time-surface`: how long ago a pixel fired, by the polarity of its last event;
 * - `count`: ON minus OFF within a window.
 *
 * The window is as long as a picture, or #GstEventRender:accumulation-time, however often pictures
 * come: windows may overlap. #GstEventRender:event-count and #GstEventRender:area-event-count limit
 * it by what happens instead of by time.
 *
 * Pictures come where no event does, too: as GAP events pass and, from a live source, by the clock.
 * At framerate 0/1 each buffer of events becomes one picture.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! eventsim-diff ! eventrender mode=decay !
 * video/x-raw,framerate=60/1 ! videoconvert ! autovideosink
 * ]|
 */
#include "elements/eventcam/eventrender.hpp"

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <utility>

#include "elements/eventcam/aggregator_pads.hpp"
#include "elements/eventcam/aggregator_seeking.hpp"
#include "elements/eventcam/broken_events.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/owned.hpp"
#include "gst/video/drawn_formats.hpp"
#include "gst/video/drawn_pool.hpp"
#include "gst/video/event_interval.hpp"
#include "gst/video/mapped_events.hpp"
#include "gst/video/video_frame.hpp"
#include "src/render/renderer.hpp"

GST_DEBUG_CATEGORY_STATIC(event_render_debug);
#define GST_CAT_DEFAULT event_render_debug

using eventcamera::Microseconds;
using eventcamera::Renderer;
using eventcamera::RenderMode;
using eventcamera::RenderSettings;

namespace {

enum Property {
  prop_0,
  prop_mode,
  prop_palette,
  prop_accumulation_time,
  prop_event_count,
  prop_area_event_count,
  prop_area_size,
  prop_full_scale,
};

/// How far decay and time-surface look back where the application leaves it open.
constexpr GstClockTime default_memory = 100 * GST_MSECOND;

/// Pictures are made through a silence, but not through one that no interval could have.
constexpr GstClockTime longest_silence = GstClockTime{G_MAXUINT32} * GST_USECOND;

/// A live source that has sent nothing for so long is taken to be silent.
constexpr GstClockTime patience = 200 * GST_MSECOND;

/// What the application sets, copied once per picture.
struct Settings {
  RenderMode mode = RenderMode::accumulate;
  GstEventCameraPalette palette = GST_EVENT_CAMERA_PALETTE_DARK;
  GstClockTime accumulation_time = 0;
  guint event_count = 0;
  guint area_event_count = 0;
  guint area_size = 16;
  gdouble full_scale = 2;
};

/// Those of the core; what a mode does not use keeps its default, so that a change of it goes
/// unnoticed.
RenderSettings core_settings(const Settings& settings) {
  RenderSettings core;
  core.mode = settings.mode;
  core.palette = palette_name_of(settings.palette);
  const auto time = settings.accumulation_time > 0 ? settings.accumulation_time : default_memory;
  const auto microseconds = static_cast<Microseconds>(std::max(time / 1000, GstClockTime{1}));
  if (settings.mode == RenderMode::decay || settings.mode == RenderMode::time_surface)
    core.time_constant = microseconds;
  else
    core.limits = {settings.event_count, settings.area_event_count,
                   static_cast<int>(settings.area_size)};
  if (settings.mode == RenderMode::decay || settings.mode == RenderMode::count)
    core.full_scale = static_cast<float>(settings.full_scale);
  return core;
}

/// The intervals of pictures at a framerate, one after the other.
class FrameTimes {
 public:
  FrameTimes(GstClockTime origin, const GstVideoInfo& video)
      : origin_(origin),
        fps_n_(static_cast<guint64>(GST_VIDEO_INFO_FPS_N(&video))),
        fps_d_(static_cast<guint64>(GST_VIDEO_INFO_FPS_D(&video))) {}

  /// Rounded up: the intervals of others at the same framerate, rounded down each, then end within
  /// ours.
  EventInterval events() const {
    const auto at = [this](guint64 index) {
      return origin_ + gst_util_uint64_scale_ceil(index, fps_d_ * GST_SECOND, fps_n_);
    };
    return {at(index_), at(index_ + 1)};
  }
  /// What the picture's buffer says.
  EventInterval picture() const {
    const auto at = [this](guint64 index) {
      return origin_ + gst_util_uint64_scale(index, fps_d_ * GST_SECOND, fps_n_);
    };
    return {at(index_), at(index_ + 1)};
  }
  void next() { ++index_; }

 private:
  GstClockTime origin_;
  guint64 fps_n_;
  guint64 fps_d_;
  guint64 index_ = 0;
};

/// What exists between caps and stop.
struct State {
  GstEventCameraInfo events;          ///< what comes in
  std::optional<GstVideoInfo> video;  ///< what goes out, once that is negotiated
  Renderer renderer;
};

struct Private {
  std::mutex mutex;  // guards what follows; nothing is called under it
  Settings settings;
  GstClockTime earliest = 0;  // running time before which pictures would come too late

  // The source pad's thread's, or nobody's while there is none.
  std::optional<State> state;
  std::optional<FrameTimes> times;  // of the next picture, once the first event is near
  std::optional<gsize> taken;       // events of the buffer that is queued first, once looked at
  GstClockTime known = 0;           // events are in up to here
  std::optional<GstClockTime> waiting_since;  // for the first event, in running time
  bool discontinuous = false;                 // the next picture does not follow on the last one
  bool warned_of_times = false;
  BrokenEvents broken{"left out"};

  void begin_anew() {
    if (state) state->renderer.reset();
    discontinuous = times.has_value();
    times.reset();
    taken.reset();
    known = 0;
    waiting_since.reset();
  }
};

struct GstEventRender {
  GstAggregator parent;
  Private* priv;
};

struct GstEventRenderClass {
  GstAggregatorClass parent_class;
};

GstEventRender* event_render(gpointer object) {
  return static_cast<GstEventRender*>(object);
}

}  // namespace

G_DEFINE_TYPE_WITH_CODE(GstEventRender, gst_event_render, GST_TYPE_AGGREGATOR,
                        GST_DEBUG_CATEGORY_INIT(event_render_debug, "eventrender", 0,
                                                "events drawn as video"))
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_render_parent_class)
GST_ELEMENT_REGISTER_DEFINE(eventrender, "eventrender", GST_RANK_PRIMARY,
                            gst_event_render_get_type())

static GType gst_event_render_mode_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(RenderMode::accumulate), "Which polarities fired within a window",
         "accumulate"},
        {static_cast<gint>(RenderMode::decay), "The sum of ON minus OFF, fading exponentially",
         "decay"},
        {static_cast<gint>(RenderMode::time_surface),
         "How long ago the last event was, by its polarity", "time-surface"},
        {static_cast<gint>(RenderMode::count), "ON minus OFF within a window", "count"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventRenderMode", values);
  }();
  return type;
}

/* properties */

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto& priv = *event_render(object)->priv;
  const std::lock_guard lock(priv.mutex);
  auto& settings = priv.settings;
  switch (id) {
    case prop_mode:
      settings.mode = static_cast<RenderMode>(g_value_get_enum(value));
      break;
    case prop_palette:
      settings.palette = static_cast<GstEventCameraPalette>(g_value_get_enum(value));
      break;
    case prop_accumulation_time:
      settings.accumulation_time = g_value_get_uint64(value);
      break;
    case prop_event_count:
      settings.event_count = g_value_get_uint(value);
      break;
    case prop_area_event_count:
      settings.area_event_count = g_value_get_uint(value);
      break;
    case prop_area_size:
      settings.area_size = g_value_get_uint(value);
      break;
    case prop_full_scale:
      settings.full_scale = g_value_get_double(value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto& priv = *event_render(object)->priv;
  const std::lock_guard lock(priv.mutex);
  const auto& settings = priv.settings;
  switch (id) {
    case prop_mode:
      g_value_set_enum(value, static_cast<gint>(settings.mode));
      break;
    case prop_palette:
      g_value_set_enum(value, settings.palette);
      break;
    case prop_accumulation_time:
      g_value_set_uint64(value, settings.accumulation_time);
      break;
    case prop_event_count:
      g_value_set_uint(value, settings.event_count);
      break;
    case prop_area_event_count:
      g_value_set_uint(value, settings.area_event_count);
      break;
    case prop_area_size:
      g_value_set_uint(value, settings.area_size);
      break;
    case prop_full_scale:
      g_value_set_double(value, settings.full_scale);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static Settings settings_of(GstEventRender* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->settings;
}

/* pads */

static GstAggregatorPad* sink_pad(GstEventRender* self) {
  return GST_AGGREGATOR_PAD(GST_ELEMENT(self)->sinkpads->data);
}

static GstSegment segment_of(GstEventRender* self) {
  GstAggregatorPad* pad = sink_pad(self);
  GST_OBJECT_LOCK(pad);
  GstSegment segment = pad->segment;
  GST_OBJECT_UNLOCK(pad);
  // Live sources send theirs with their first buffer.
  if (segment.format != GST_FORMAT_TIME) gst_segment_init(&segment, GST_FORMAT_TIME);
  return segment;
}

/* pictures */

/// Where a window that ends at `end` begins, which shows `interval`.
static Microseconds window_start(const Settings& settings, const EventInterval& interval) {
  if (settings.accumulation_time > 0)
    return interval.end > settings.accumulation_time
               ? static_cast<Microseconds>((interval.end - settings.accumulation_time) / 1000)
               : -1;
  if (settings.event_count > 0 || settings.area_event_count > 0) return -1;
  return static_cast<Microseconds>(interval.start / 1000);
}

/// Whether sinks would drop a picture anyway.
static bool comes_too_late(GstEventRender* self, const EventInterval& picture) {
  const GstSegment segment = segment_of(self);
  const guint64 time = gst_segment_to_running_time(&segment, GST_FORMAT_TIME, picture.start);
  const std::lock_guard lock(self->priv->mutex);
  return GST_CLOCK_TIME_IS_VALID(time) && time < self->priv->earliest;
}

static GstFlowReturn draw(GstEventRender* self, const EventInterval& events, GstBuffer* buffer) {
  auto& state = *self->priv->state;
  const Settings settings = settings_of(self);
  state.renderer.configure(core_settings(settings));
  const VideoFrame frame(*state.video, buffer, GST_MAP_WRITE);
  if (!frame) {
    GST_ELEMENT_ERROR(self, RESOURCE, FAILED, ("A buffer could not be mapped for drawing."),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  state.renderer.draw(window_start(settings, events), static_cast<Microseconds>(events.end / 1000),
                      pixel_layout_of(*state.video), frame.data(), frame.stride());
  return GST_FLOW_OK;
}

static GstFlowReturn acquire_buffer(GstEventRender* self, GstBuffer** buffer) {
  GstBufferPool* pool = gst_aggregator_get_buffer_pool(GST_AGGREGATOR(self));
  if (pool == nullptr) return GST_FLOW_NOT_NEGOTIATED;
  GstFlowReturn result = GST_FLOW_ERROR;
  if (gst_buffer_pool_set_active(pool, TRUE))  // GstAggregator leaves that to us
    result = gst_buffer_pool_acquire_buffer(pool, buffer, nullptr);
  else
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("There are no buffers to draw in."), (nullptr));
  gst_object_unref(pool);
  return result;
}

/// Draws the state at the end of an interval and sends it on. May throw.
static GstFlowReturn push_picture(GstEventRender* self, const EventInterval& events,
                                  const EventInterval& picture) {
  auto* aggregator = GST_AGGREGATOR(self);
  if (comes_too_late(self, picture)) {
    GST_DEBUG_OBJECT(self, "left out the picture at %" GST_TIME_FORMAT,
                     GST_TIME_ARGS(picture.start));
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  GstBuffer* acquired = nullptr;
  GstFlowReturn result = acquire_buffer(self, &acquired);
  if (result != GST_FLOW_OK) return result;
  OwnedBuffer buffer(acquired);
  result = draw(self, events, acquired);
  if (result != GST_FLOW_OK) return result;
  GST_BUFFER_PTS(acquired) = picture.start;
  GST_BUFFER_DTS(acquired) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(acquired) = picture.end - picture.start;
  if (std::exchange(self->priv->discontinuous, false))
    GST_BUFFER_FLAG_SET(acquired, GST_BUFFER_FLAG_DISCONT);
  return gst_aggregator_finish_buffer(aggregator, buffer.release());
}

/// The picture that is due. May throw.
static GstFlowReturn push_next_picture(GstEventRender* self) {
  auto& times = *self->priv->times;
  const EventInterval events = times.events();
  const EventInterval picture = times.picture();
  const GstSegment segment = segment_of(self);
  if (GST_CLOCK_TIME_IS_VALID(segment.stop) && picture.start >= segment.stop) return GST_FLOW_EOS;
  times.next();
  return push_picture(self, events, picture);
}

/// Whether anything is known of the picture that is due.
static bool has_begun_picture(GstEventRender* self) {
  const auto& priv = *self->priv;
  return priv.state && priv.state->video && priv.times &&
         priv.known > priv.times->events().start + event_resolution;
}

/* events */

static void warn_of_times(GstEventRender* self) {
  GST_WARNING_OBJECT(self, "events without a time");
  if (std::exchange(self->priv->warned_of_times, true)) return;
  GST_ELEMENT_WARNING(self, STREAM, FORMAT, ("A buffer of events has no PTS; it is left out."),
                      (nullptr));
}

/// Draws the events of a buffer up to some time; all of them where none is given. Tells whether
/// these were all. May throw.
static bool take_events(GstEventRender* self, const MappedEvents& mapped,
                        std::optional<GstClockTime> end) {
  auto& priv = *self->priv;
  const auto start = mapped.start();
  const auto rest = mapped.events().subspan(std::min(*priv.taken, mapped.events().size()));
  auto first_after = rest.end();
  if (end)
    first_after = std::ranges::find_if(
        rest, [&, last = static_cast<Microseconds>(*end / 1000)](const eventcamera::Event& event) {
          return eventcamera::time_of(event, start) > last;
        });
  const auto due = rest.first(static_cast<std::size_t>(first_after - rest.begin()));
  *priv.taken += due.size();
  priv.state->renderer.configure(core_settings(settings_of(self)));
  if (priv.state->renderer.add(due, start) > 0)
    priv.broken.warn(self, "some lie beyond the sensor");
  return first_after == rest.end();
}

static void drop_buffer(GstEventRender* self) {
  self->priv->taken.reset();
  gst_aggregator_pad_drop_buffer(sink_pad(self));
}

/// Goes on to the time of a buffer. Tells whether a picture is due before it can be taken.
static bool approach(GstEventRender* self, GstBuffer* buffer, const EventInterval& interval) {
  auto& priv = *self->priv;
  if (!priv.taken) {
    const bool returns =
        GST_BUFFER_IS_DISCONT(buffer) && interval.start + event_resolution < priv.known;
    const bool leaps = priv.times && interval.start > priv.times->events().end + longest_silence;
    if (returns || leaps) priv.begin_anew();
    priv.taken = 0;
  }
  const GstSegment segment = segment_of(self);
  if (!priv.times && GST_VIDEO_INFO_FPS_N(&*priv.state->video) > 0 &&
      (interval.end > segment.start || interval.start >= segment.start))
    priv.times.emplace(std::max(interval.start, segment.start), *priv.state->video);
  return priv.times && interval.start >= priv.times->events().end;
}

/// Takes what is due of a buffer, and sends the picture on that this completes. May throw.
static GstFlowReturn take_buffer(GstEventRender* self, GstBuffer* buffer) {
  auto& priv = *self->priv;
  const auto interval = interval_of(buffer);
  if (!interval) {
    warn_of_times(self);
    drop_buffer(self);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (approach(self, buffer, *interval)) return push_next_picture(self);
  std::optional<GstClockTime> due;
  if (priv.times) due = priv.times->events().end;
  bool all = false;
  {
    const MappedEvents mapped(buffer);
    if (!mapped) {
      priv.broken.warn(self, "a buffer is no whole number of events");
      drop_buffer(self);
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
    all = take_events(self, mapped, due);
  }
  priv.known = std::max(priv.known, interval->end);
  if (due && (!all || interval->end + event_resolution > *due)) return push_next_picture(self);
  drop_buffer(self);
  if (GST_VIDEO_INFO_FPS_N(&*priv.state->video) > 0 || interval->end <= segment_of(self).start)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  return push_picture(self, *interval, *interval);
}

/// A live source is silent: the first picture begins now.
static void begin_now(GstEventRender* self) {
  const GstSegment segment = segment_of(self);
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(self));
  const guint64 position = gst_segment_position_from_running_time(&segment, GST_FORMAT_TIME, now);
  if (GST_CLOCK_TIME_IS_VALID(position) && GST_VIDEO_INFO_FPS_N(&*self->priv->state->video) > 0)
    self->priv->times.emplace(position, *self->priv->state->video);
}

/// May throw.
static GstFlowReturn take_next(GstEventRender* self, bool timed_out) {
  auto& priv = *self->priv;
  GstAggregatorPad* pad = sink_pad(self);
  if (timed_out) priv.waiting_since.reset();  // where nothing can begin yet, wait as long again
  if (!priv.state || !priv.state->video) {
    if (gst_aggregator_pad_is_eos(pad)) return GST_FLOW_EOS;
    return gst_aggregator_pad_has_buffer(pad) ? GST_FLOW_NOT_NEGOTIATED
                                              : GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (const OwnedBuffer buffer{gst_aggregator_pad_peek_buffer(pad)})
    return take_buffer(self, buffer.get());
  if (gst_aggregator_pad_is_eos(pad))
    return has_begun_picture(self) ? push_next_picture(self) : GST_FLOW_EOS;
  if (!timed_out) return GST_AGGREGATOR_FLOW_NEED_DATA;
  if (priv.times) return push_next_picture(self);
  begin_now(self);
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

static void report_no_memory(GstEventRender* self) {
  self->priv->state.reset();
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                    ("There is not enough memory to draw these events."), (nullptr));
}

static GstFlowReturn aggregate(GstAggregator* aggregator, gboolean timed_out) {
  auto* self = event_render(aggregator);
  try {
    return take_next(self, timed_out != FALSE);
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return GST_FLOW_ERROR;
  }
}

/// When to go on without events, from a live source.
static GstClockTime get_next_time(GstAggregator* aggregator) {
  auto* self = event_render(aggregator);
  auto& priv = *self->priv;
  if (!priv.state) return GST_CLOCK_TIME_NONE;
  if (!priv.times) {
    const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(self));
    if (!priv.waiting_since && GST_CLOCK_TIME_IS_VALID(now)) priv.waiting_since = now;
    return priv.waiting_since ? *priv.waiting_since + patience : GST_CLOCK_TIME_NONE;
  }
  const GstSegment segment = segment_of(self);
  return gst_segment_to_running_time(&segment, GST_FORMAT_TIME, priv.times->picture().start);
}

/* negotiation */

static GstFlowReturn update_src_caps(GstAggregator* aggregator, GstCaps* downstream,
                                     GstCaps** result) {
  const auto& state = event_render(aggregator)->priv->state;
  if (!state) return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstCaps* ours = gst_pad_get_pad_template_caps(GST_AGGREGATOR_SRC_PAD(aggregator));
  ours = gst_caps_make_writable(ours);
  gst_caps_set_simple(ours, "width", G_TYPE_INT, state->events.width, "height", G_TYPE_INT,
                      state->events.height, nullptr);
  *result = gst_caps_intersect_full(downstream, ours, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(ours);
  return gst_caps_is_empty(*result) ? GST_FLOW_NOT_NEGOTIATED : GST_FLOW_OK;
}

static GstCaps* fixate_src_caps(GstAggregator*, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, 0), "framerate", 30, 1);
  return gst_caps_fixate(caps);
}

static gboolean negotiated_src_caps(GstAggregator* aggregator, GstCaps* caps) {
  auto& priv = *event_render(aggregator)->priv;
  GstVideoInfo video;
  if (!priv.state || !gst_video_info_from_caps(&video, caps)) return FALSE;
  const auto n = GST_VIDEO_INFO_FPS_N(&video);
  const auto d = GST_VIDEO_INFO_FPS_D(&video);
  if (priv.times) {
    const GstClockTime start = priv.times->picture().start;
    priv.times.reset();
    if (n > 0) priv.times.emplace(start, video);
  }
  priv.state->video = video;
  const GstClockTime latency = n > 0 ? gst_util_uint64_scale_int(GST_SECOND, d, n) : 0;
  gst_aggregator_set_latency(aggregator, latency, latency);
  return TRUE;
}

static gboolean decide_allocation(GstAggregator*, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  return decide_on_drawn_pool(query, caps);
}

/* events, queries, states */

/// Sends on what there is of the last picture before things change.
static void drain(GstEventRender* self) {
  if (!has_begun_picture(self)) return;
  try {
    push_next_picture(self);
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
  }
}

static bool take_caps(GstEventRender* self, GstEvent* event) {
  auto& priv = *self->priv;
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    GST_ERROR_OBJECT(self, "cannot draw %" GST_PTR_FORMAT, caps);
    return false;
  }
  if (priv.state && priv.state->events.width == info.width &&
      priv.state->events.height == info.height)
    return true;
  drain(self);
  priv.state.reset();  // before the next is made: pictures can be large
  try {
    priv.state.emplace(State{info, std::nullopt,
                             Renderer(info.width, info.height, core_settings(settings_of(self)))});
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return false;
  }
  gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(self));
  return true;
}

static bool take_segment(GstEventRender* self, GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  if (!plays_forwards(self, *segment, "drawn")) return false;
  const GstSegment current = segment_of(self);
  if (current.rate != segment->rate || current.base != segment->base ||
      current.start != segment->start || current.time != segment->time) {
    drain(self);
    self->priv->begin_anew();
  }
  gst_aggregator_update_segment(GST_AGGREGATOR(self), segment);
  return true;
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  auto* self = event_render(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    const bool taken = take_caps(self, event);
    gst_event_unref(event);
    return taken;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !take_segment(self, event)) {
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_event(GstAggregator* aggregator, GstEvent* event) {
  auto* self = event_render(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    // Not for upstream, which would leave events out.
    GstClockTimeDiff late = 0;
    GstClockTime time = GST_CLOCK_TIME_NONE;
    gst_event_parse_qos(event, nullptr, nullptr, &late, &time);
    gst_event_unref(event);
    const std::lock_guard lock(self->priv->mutex);
    if (GST_CLOCK_TIME_IS_VALID(time))
      self->priv->earliest = late > 0 ? time + 2 * static_cast<GstClockTime>(late) : 0;
    return TRUE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && !would_seek(sink_pad(self), event)) {
    GST_WARNING_OBJECT(self, "refused %" GST_PTR_FORMAT, event);
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_AGGREGATOR_CLASS->src_event(aggregator, event);
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_SEEKING)
    return answer_seeking(sink_pad(event_render(aggregator)), query);
  return PARENT_AGGREGATOR_CLASS->src_query(aggregator, query);
}

static void forget_lateness(GstEventRender* self) {
  const std::lock_guard lock(self->priv->mutex);
  self->priv->earliest = 0;
}

static GstFlowReturn flush(GstAggregator* aggregator) {
  auto* self = event_render(aggregator);
  forget_lateness(self);
  try {
    self->priv->begin_anew();
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return GST_FLOW_ERROR;
  }
  return GST_FLOW_OK;
}

static gboolean stop(GstAggregator* aggregator) {
  auto* self = event_render(aggregator);
  auto& priv = *self->priv;
  priv.state.reset();
  priv.begin_anew();
  priv.discontinuous = priv.warned_of_times = false;
  priv.broken.begin_anew();
  forget_lateness(self);
  return TRUE;
}

/* type */

static void finalize(GObject* object) {
  delete event_render(object)->priv;
  G_OBJECT_CLASS(gst_event_render_parent_class)->finalize(object);
}

static void gst_event_render_init(GstEventRender* self) {
  self->priv = new Private;
  GstPadTemplate* pad_template =
      gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "sink");
  auto* pad = GST_PAD(g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", "sink", "direction",
                                   GST_PAD_SINK, "template", pad_template, nullptr));
  gst_element_add_pad(GST_ELEMENT(self), pad);
}

static void gst_event_render_class_init(GstEventRenderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;

  constexpr auto flags = static_cast<GParamFlags>(
      G_PARAM_READWRITE | G_PARAM_CONSTRUCT | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  const Settings defaults;
  g_object_class_install_property(
      object_class, prop_mode,
      g_param_spec_enum("mode", "Mode", "What a picture shows", gst_event_render_mode_get_type(),
                        static_cast<gint>(defaults.mode), flags));
  g_object_class_install_property(
      object_class, prop_palette,
      g_param_spec_enum("palette", "Palette",
                        "The colours; those of viridis and magma show how much, whichever polarity",
                        GST_TYPE_EVENT_CAMERA_PALETTE, defaults.palette, flags));
  g_object_class_install_property(
      object_class, prop_accumulation_time,
      g_param_spec_uint64(
          "accumulation-time", "Accumulation time",
          "How long the window of accumulate and count is, the time in which decay fades to 1/e, "
          "and how long time-surface looks back (ns; 0 = as long as a picture lasts, or as the "
          "counts allow, for accumulate and count, and 100 ms for the others)",
          0, std::numeric_limits<gint64>::max(), defaults.accumulation_time, flags));
  g_object_class_install_property(
      object_class, prop_event_count,
      g_param_spec_uint("event-count", "Event count",
                        "The most events in the window of accumulate and count (events; 0 = any)",
                        0, eventcamera::RecentEvents::most, defaults.event_count, flags));
  g_object_class_install_property(
      object_class, prop_area_event_count,
      g_param_spec_uint("area-event-count", "Area event count",
                        "The most events in any one area in the window of accumulate and count: "
                        "the busiest place decides how long it is (events; 0 = any)",
                        0, eventcamera::RecentEvents::most, defaults.area_event_count, flags));
  g_object_class_install_property(
      object_class, prop_area_size,
      g_param_spec_uint("area-size", "Area size",
                        "The side of the squares that area-event-count counts in (pixels)", 1,
                        16384, defaults.area_size, flags));
  g_object_class_install_property(
      object_class, prop_full_scale,
      g_param_spec_double("full-scale", "Full scale",
                          "How many events of a pixel have the full colour, for decay and count "
                          "(events)",
                          0.1, 1e6, defaults.full_scale, flags));

  static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
      "sink", GST_PAD_SINK, GST_PAD_ALWAYS,
      GST_STATIC_CAPS(GST_EVENT_CAMERA_MEDIA_TYPE
                      ", format = (string) XYTP, width = (int) [ 1, 16384 ], "
                      "height = (int) [ 1, 16384 ]"));
  static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
      "src", GST_PAD_SRC, GST_PAD_ALWAYS,
      GST_STATIC_CAPS("video/x-raw, format = (string) " DRAWN_VIDEO_FORMATS
                      ", width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ], "
                      "framerate = (fraction) [ 0, max ], "
                      "pixel-aspect-ratio = (fraction) 1/1"));
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template,
                                                       GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &src_template,
                                                       GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata(element_class, "Event renderer", "Codec/Decoder/Video",
                                        "Draws events as video", "gst-eventsim");

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->aggregate = aggregate;
  aggregator_class->get_next_time = get_next_time;
  aggregator_class->update_src_caps = update_src_caps;
  aggregator_class->fixate_src_caps = fixate_src_caps;
  aggregator_class->negotiated_src_caps = negotiated_src_caps;
  aggregator_class->decide_allocation = decide_allocation;
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_event = src_event;
  aggregator_class->src_query = src_query;
  aggregator_class->flush = flush;
  aggregator_class->stop = stop;
  gst_type_mark_as_plugin_api(gst_event_render_mode_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_CAMERA_PALETTE, static_cast<GstPluginAPIFlags>(0));
}
