// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventoverlay
 * @title: eventoverlay
 * @short_description: draws events over video
 *
 * Draws a stream of events, which comes in on the pad `events`, over the video that comes in on the
 * pad `sink`: over each frame the events of the interval that begins with it, or those of the last
 * #GstEventOverlay:accumulation-time of that interval. The two are held together by their running
 * times. Where the sensor has another size than the video, its pixels are scaled to it.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball ! tee name=t  t. ! queue ! videoconvert ! eventoverlay
 * name=overlay ! videoconvert ! autovideosink  t. ! queue ! eventsim-diff ! overlay.events
 * ]|
 */
#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <utility>

#include "elements/eventcam/aggregator_pads.hpp"
#include "elements/eventcam/aggregator_seeking.hpp"
#include "elements/eventcam/broken_events.hpp"
#include "gst/base/drawn_video.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/render/overlay.hpp"

GST_DEBUG_CATEGORY_STATIC(event_overlay_debug);
#define GST_CAT_DEFAULT event_overlay_debug

using eventcamera::Microseconds;
using eventcamera::Overlay;
using eventcamera::Size;

namespace {

enum Property {
  prop_0,
  prop_palette,
  prop_opacity,
  prop_accumulation_time,
};

/// What the application sets, copied once per frame.
struct Settings {
  GstEventCameraPalette palette = GST_EVENT_CAMERA_PALETTE_RED_BLUE;
  gdouble opacity = 1;
  GstClockTime accumulation_time = 0;
};

struct Private {
  std::mutex mutex;  // guards what follows; nothing is called under it
  Settings settings;

  // Set at init.
  GstAggregatorPad* video_pad = nullptr;
  GstAggregatorPad* events_pad = nullptr;

  // The source pad's thread's, or nobody's while there is none.
  std::optional<GstVideoInfo> video;
  OwnedCaps video_caps;
  std::optional<Size> sensor;
  std::optional<Overlay> overlay;  // once both are known
  gsize taken = 0;                 // events of the buffer that is queued first
  GstClockTime known = 0;          // events are in up to this running time
  BrokenEvents broken{"left out"};

  void begin_anew() {
    overlay.reset();
    taken = 0;
    known = 0;
  }
};

struct GstEventOverlay {
  GstAggregator parent;
  Private* priv;
};

struct GstEventOverlayClass {
  GstAggregatorClass parent_class;
};

GstEventOverlay* event_overlay(gpointer object) {
  return static_cast<GstEventOverlay*>(object);
}

}  // namespace

G_DEFINE_TYPE_WITH_CODE(GstEventOverlay, gst_event_overlay, GST_TYPE_AGGREGATOR,
                        GST_DEBUG_CATEGORY_INIT(event_overlay_debug, "eventoverlay", 0,
                                                "events drawn over video"))
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_overlay_parent_class)
GST_ELEMENT_REGISTER_DEFINE(eventoverlay, "eventoverlay", GST_RANK_NONE,
                            gst_event_overlay_get_type())

/* properties */

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto& priv = *event_overlay(object)->priv;
  const std::lock_guard lock(priv.mutex);
  switch (id) {
    case prop_palette:
      priv.settings.palette = static_cast<GstEventCameraPalette>(g_value_get_enum(value));
      break;
    case prop_opacity:
      priv.settings.opacity = g_value_get_double(value);
      break;
    case prop_accumulation_time:
      priv.settings.accumulation_time = g_value_get_uint64(value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto& priv = *event_overlay(object)->priv;
  const std::lock_guard lock(priv.mutex);
  switch (id) {
    case prop_palette:
      g_value_set_enum(value, priv.settings.palette);
      break;
    case prop_opacity:
      g_value_set_double(value, priv.settings.opacity);
      break;
    case prop_accumulation_time:
      g_value_set_uint64(value, priv.settings.accumulation_time);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static Settings settings_of(GstEventOverlay* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->settings;
}

/* time */

/// The running time of something that begins at `time`; nothing where it lies outside the segment.
static std::optional<GstClockTime> running_time(GstAggregatorPad* pad, GstClockTime time) {
  GST_OBJECT_LOCK(pad);
  const guint64 running = gst_segment_to_running_time(&pad->segment, GST_FORMAT_TIME, time);
  GST_OBJECT_UNLOCK(pad);
  if (!GST_CLOCK_TIME_IS_VALID(running)) return std::nullopt;
  return running;
}

/// An interval in running time.
static std::optional<EventInterval> running_interval(GstAggregatorPad* pad,
                                                     const EventInterval& interval) {
  const auto start = running_time(pad, interval.start);
  if (!start) return std::nullopt;
  return EventInterval{*start, *start + (interval.end - interval.start)};
}

static GstClockTime frame_duration(const GstVideoInfo& video) {
  if (GST_VIDEO_INFO_FPS_N(&video) <= 0) return 0;
  return gst_util_uint64_scale_int(GST_SECOND, GST_VIDEO_INFO_FPS_D(&video),
                                   GST_VIDEO_INFO_FPS_N(&video));
}

/// How long a frame stands.
static std::optional<EventInterval> interval_of_frame(GstEventOverlay* self, GstBuffer* frame) {
  const GstClockTime start = GST_BUFFER_PTS(frame);
  if (!GST_CLOCK_TIME_IS_VALID(start) || start > G_MAXINT64) return std::nullopt;
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID(frame)
                                    ? GST_BUFFER_DURATION(frame)
                                    : frame_duration(*self->priv->video);
  return running_interval(self->priv->video_pad,
                          {start, start + std::min(duration, GstClockTime{G_MAXINT64} - start)});
}

/* events */

/// Takes the events of a buffer up to some running time. Tells whether these were all. May throw.
static bool take_events(GstEventOverlay* self, GstBuffer* buffer, GstClockTime start,
                        GstClockTime end) {
  auto& priv = *self->priv;
  const MappedEvents mapped(buffer);
  if (!mapped) {
    priv.broken.warn(self, "a buffer is no whole number of events");
    return true;
  }
  const auto origin = static_cast<Microseconds>(start / 1000);
  const auto last = static_cast<Microseconds>(end / 1000);
  const auto rest = mapped.events().subspan(std::min(priv.taken, mapped.events().size()));
  const auto first_after = std::ranges::find_if(rest, [&](const eventcamera::Event& event) {
    return eventcamera::time_of(event, origin) > last;
  });
  const auto due = rest.first(static_cast<std::size_t>(first_after - rest.begin()));
  const bool took_all = due.size() == rest.size();
  priv.taken += due.size();
  if (priv.overlay->add(due, origin) > 0) priv.broken.warn(self, "some lie beyond the sensor");
  return took_all;
}

/// Takes what is due of the buffer that is queued first. Tells whether more is to come before
/// `end`, a running time. May throw.
static bool take_buffer(GstEventOverlay* self, GstBuffer* buffer, GstClockTime end) {
  auto& priv = *self->priv;
  const auto interval = interval_of(buffer);
  const auto running = interval ? running_interval(priv.events_pad, *interval) : std::nullopt;
  if (!interval) priv.broken.warn(self, "a buffer has no PTS");
  if (running) {
    if (running->start >= end || !take_events(self, buffer, running->start, end)) return false;
    priv.known = std::max(priv.known, running->end);
  }
  priv.taken = 0;
  gst_aggregator_pad_drop_buffer(priv.events_pad);
  return priv.known + event_resolution <= end;
}

/// Takes the events up to `end`, a running time. Tells whether these are all that there will be,
/// as far as can be known. May throw.
static bool take_events_until(GstEventOverlay* self, GstClockTime end) {
  auto& priv = *self->priv;
  while (priv.known + event_resolution <= end) {
    const OwnedBuffer buffer(gst_aggregator_pad_peek_buffer(priv.events_pad));
    if (!buffer) return gst_aggregator_pad_is_eos(priv.events_pad);
    if (!take_buffer(self, buffer.get(), end)) return true;
  }
  return true;
}

/* frames */

static GstFlowReturn draw(GstEventOverlay* self, const EventInterval& interval, GstBuffer* buffer) {
  auto& priv = *self->priv;
  const Settings settings = settings_of(self);
  const VideoFrame frame(*priv.video, buffer, static_cast<GstMapFlags>(GST_MAP_READWRITE));
  if (!frame) {
    GST_ELEMENT_ERROR(self, RESOURCE, FAILED, ("A frame could not be mapped for drawing."),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const auto end = static_cast<Microseconds>(interval.end / 1000);
  const auto start = settings.accumulation_time > 0
                         ? end - static_cast<Microseconds>(settings.accumulation_time / 1000)
                         : static_cast<Microseconds>(interval.start / 1000);
  priv.overlay->draw(start, end, eventcamera::palette(palette_name_of(settings.palette)),
                     settings.opacity, pixel_layout_of(*priv.video), frame.data(), frame.stride());
  return GST_FLOW_OK;
}

/// Draws on the frame that is queued first, and sends it on. May throw.
static GstFlowReturn take_frame(GstEventOverlay* self, const std::optional<EventInterval>& interval,
                                bool timed_out) {
  auto& priv = *self->priv;
  if (interval && priv.sensor) {
    if (!priv.overlay)
      priv.overlay.emplace(*priv.sensor, Size{GST_VIDEO_INFO_WIDTH(&*priv.video),
                                              GST_VIDEO_INFO_HEIGHT(&*priv.video)});
    if (!take_events_until(self, interval->end) && !timed_out) return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  GstBuffer* out = gst_buffer_make_writable(gst_aggregator_pad_pop_buffer(priv.video_pad));
  if (interval && priv.overlay) {
    const GstFlowReturn result = draw(self, *interval, out);
    if (result != GST_FLOW_OK) {
      gst_buffer_unref(out);
      return result;
    }
  }
  return gst_aggregator_finish_buffer(GST_AGGREGATOR(self), out);
}

static void report_no_memory(GstEventOverlay* self) {
  self->priv->begin_anew();
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                    ("There is not enough memory to draw these events."), (nullptr));
}

static GstFlowReturn aggregate(GstAggregator* aggregator, gboolean timed_out) {
  auto* self = event_overlay(aggregator);
  auto& priv = *self->priv;
  GstBuffer* frame = gst_aggregator_pad_peek_buffer(priv.video_pad);
  if (frame == nullptr)
    return gst_aggregator_pad_is_eos(priv.video_pad) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
  const auto interval = priv.video ? interval_of_frame(self, frame) : std::nullopt;
  gst_buffer_unref(frame);  // else it could not be drawn on where it lies
  if (!priv.video) return GST_FLOW_NOT_NEGOTIATED;
  try {
    return take_frame(self, interval, timed_out != FALSE);
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return GST_FLOW_ERROR;
  }
}

/// When a frame from a live source goes on without events.
static GstClockTime get_next_time(GstAggregator* aggregator) {
  auto& priv = *event_overlay(aggregator)->priv;
  GstBuffer* frame = gst_aggregator_pad_peek_buffer(priv.video_pad);
  if (frame == nullptr) return GST_CLOCK_TIME_NONE;
  const auto time = GST_BUFFER_PTS_IS_VALID(frame)
                        ? running_time(priv.video_pad, GST_BUFFER_PTS(frame))
                        : std::nullopt;
  gst_buffer_unref(frame);
  return time.value_or(GST_CLOCK_TIME_NONE);
}

/* negotiation */

static GstFlowReturn update_src_caps(GstAggregator* aggregator, GstCaps*, GstCaps** result) {
  const auto& priv = *event_overlay(aggregator)->priv;
  if (!priv.video) return GST_AGGREGATOR_FLOW_NEED_DATA;
  *result = gst_caps_ref(priv.video_caps.get());
  return GST_FLOW_OK;
}

static bool take_video_caps(GstEventOverlay* self, GstCaps* caps) {
  auto& priv = *self->priv;
  GstVideoInfo video;
  if (!gst_video_info_from_caps(&video, caps)) return false;
  if (!priv.video || GST_VIDEO_INFO_WIDTH(&*priv.video) != GST_VIDEO_INFO_WIDTH(&video) ||
      GST_VIDEO_INFO_HEIGHT(&*priv.video) != GST_VIDEO_INFO_HEIGHT(&video))
    priv.overlay.reset();
  priv.video = video;
  priv.video_caps.reset(gst_caps_ref(caps));
  const GstClockTime latency = frame_duration(video);
  gst_aggregator_set_latency(GST_AGGREGATOR(self), latency, latency);
  gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(self));
  if (!gst_pad_is_linked(GST_PAD(priv.events_pad)))
    GST_ELEMENT_WARNING(
        self, CORE, PAD,
        ("No events come to the pad \"events\". There is no picture before they do."), (nullptr));
  return true;
}

static bool take_events_caps(GstEventOverlay* self, const GstCaps* caps) {
  auto& priv = *self->priv;
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) return false;
  const Size sensor{info.width, info.height};
  if (priv.sensor != sensor) priv.overlay.reset();
  priv.sensor = sensor;
  return true;
}

/// The frames are drawn on as they come, so downstream must take what upstream makes.
static gboolean sink_query(GstAggregator* aggregator, GstAggregatorPad* pad, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_CAPS || pad != event_overlay(aggregator)->priv->video_pad)
    return PARENT_AGGREGATOR_CLASS->sink_query(aggregator, pad, query);
  answer_caps_of_passed(aggregator, pad, query);
  return TRUE;
}

/* events, states */

static bool take_segment(GstEventOverlay* self, GstAggregatorPad* pad, GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  if (!plays_forwards(self, *segment, "drawn")) return false;
  if (pad == self->priv->video_pad) gst_aggregator_update_segment(GST_AGGREGATOR(self), segment);
  return true;
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  auto* self = event_overlay(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    const bool taken =
        pad == self->priv->video_pad ? take_video_caps(self, caps) : take_events_caps(self, caps);
    gst_event_unref(event);
    return taken;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !take_segment(self, pad, event)) {
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_event(GstAggregator* aggregator, GstEvent* event) {
  auto* self = event_overlay(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) {
    for (GstAggregatorPad* pad : {self->priv->video_pad, self->priv->events_pad}) {
      if (would_seek(pad, event)) continue;
      GST_WARNING_OBJECT(self, "refused %" GST_PTR_FORMAT, event);
      gst_event_unref(event);
      return FALSE;
    }
  }
  return PARENT_AGGREGATOR_CLASS->src_event(aggregator, event);
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_SEEKING)
    return answer_seeking(event_overlay(aggregator)->priv->video_pad, query);
  return PARENT_AGGREGATOR_CLASS->src_query(aggregator, query);
}

static GstFlowReturn flush(GstAggregator* aggregator) {
  event_overlay(aggregator)->priv->begin_anew();
  return GST_FLOW_OK;
}

static gboolean stop(GstAggregator* aggregator) {
  auto& priv = *event_overlay(aggregator)->priv;
  priv.begin_anew();
  priv.video.reset();
  priv.video_caps.reset();
  priv.sensor.reset();
  priv.broken.begin_anew();
  return TRUE;
}

/* type */

static void finalize(GObject* object) {
  delete event_overlay(object)->priv;
  G_OBJECT_CLASS(gst_event_overlay_parent_class)->finalize(object);
}

static void gst_event_overlay_init(GstEventOverlay* self) {
  self->priv = new Private;
  self->priv->video_pad = add_sink_pad(self, "sink");
  self->priv->events_pad = add_sink_pad(self, "events");
}

static void gst_event_overlay_class_init(GstEventOverlayClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;

  constexpr auto flags = static_cast<GParamFlags>(
      G_PARAM_READWRITE | G_PARAM_CONSTRUCT | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  const Settings defaults;
  g_object_class_install_property(
      object_class, prop_palette,
      g_param_spec_enum("palette", "Palette",
                        "The colours of pixels with ON, with OFF, and with "
                        "both",
                        GST_TYPE_EVENT_CAMERA_PALETTE, defaults.palette, flags));
  g_object_class_install_property(
      object_class, prop_opacity,
      g_param_spec_double("opacity", "Opacity",
                          "How much of the video events cover (0 = nothing, 1 = all)", 0, 1,
                          defaults.opacity, flags));
  g_object_class_install_property(
      object_class, prop_accumulation_time,
      g_param_spec_uint64("accumulation-time", "Accumulation time",
                          "Over how long events are shown (ns; 0 = as long as a frame lasts)", 0,
                          std::numeric_limits<gint64>::max(), defaults.accumulation_time, flags));

#define DRAWN_VIDEO_CAPS                                                    \
  "video/x-raw, format = (string) " DRAWN_VIDEO_FORMATS                     \
  ", width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ], framerate = " \
  "(fraction) [ 0, max ]"
  static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
      "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(DRAWN_VIDEO_CAPS));
  static GstStaticPadTemplate events_template = GST_STATIC_PAD_TEMPLATE(
      "events", GST_PAD_SINK, GST_PAD_ALWAYS,
      GST_STATIC_CAPS(GST_EVENT_CAMERA_MEDIA_TYPE
                      ", format = (string) XYTP, width = (int) [ 1, 16384 ], "
                      "height = (int) [ 1, 16384 ]"));
  static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
      "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(DRAWN_VIDEO_CAPS));
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  for (auto* pad_template : {&sink_template, &events_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype(element_class, pad_template,
                                                         GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata(element_class, "Event overlay", "Filter/Editor/Video",
                                        "Draws events over video", "gst-eventsim");

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->aggregate = aggregate;
  aggregator_class->get_next_time = get_next_time;
  aggregator_class->update_src_caps = update_src_caps;
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_event = src_event;
  aggregator_class->src_query = src_query;
  aggregator_class->sink_query = sink_query;
  aggregator_class->flush = flush;
  aggregator_class->stop = stop;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_CAMERA_PALETTE, static_cast<GstPluginAPIFlags>(0));
}
