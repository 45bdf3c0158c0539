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
#include <mutex>
#include <new>

#include "elements/eventcam/aggregator_pads.hpp"
#include "elements/eventcam/aggregator_seeking.hpp"
#include "elements/eventcam/eventrender/events.hpp"
#include "elements/eventcam/eventrender/negotiation.hpp"
#include "elements/eventcam/eventrender/pictures.hpp"
#include "elements/eventcam/eventrender/properties.hpp"
#include "elements/eventcam/eventrender/state.hpp"
#include "gst/base/drawn_video.hpp"

using eventrender::event_render;

GST_DEBUG_CATEGORY(event_render_debug);

G_DEFINE_TYPE_WITH_CODE(GstEventRender, gst_event_render, GST_TYPE_AGGREGATOR,
                        GST_DEBUG_CATEGORY_INIT(event_render_debug, "eventrender", 0,
                                                "events drawn as video"))
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_render_parent_class)
GST_ELEMENT_REGISTER_DEFINE(eventrender, "eventrender", GST_RANK_PRIMARY,
                            gst_event_render_get_type())

/* events, queries, states */

static bool take_segment(GstEventRender* self, GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  if (!plays_forwards(self, *segment, "drawn")) return false;
  const GstSegment current = eventrender::segment_of(self);
  if (current.rate != segment->rate || current.base != segment->base ||
      current.start != segment->start || current.time != segment->time) {
    eventrender::drain(self);
    self->priv->begin_anew();
  }
  gst_aggregator_update_segment(GST_AGGREGATOR(self), segment);
  return true;
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  auto* self = event_render(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    const bool taken = eventrender::take_caps(self, event);
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
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && !would_seek(eventrender::sink_pad(self), event)) {
    GST_WARNING_OBJECT(self, "refused %" GST_PTR_FORMAT, event);
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_AGGREGATOR_CLASS->src_event(aggregator, event);
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_SEEKING)
    return answer_seeking(eventrender::sink_pad(event_render(aggregator)), query);
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
    eventrender::report_no_memory(self);
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
  self->priv = new GstEventRenderPrivate;
  GstPadTemplate* pad_template =
      gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "sink");
  auto* pad = GST_PAD(g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", "sink", "direction",
                                   GST_PAD_SINK, "template", pad_template, nullptr));
  gst_element_add_pad(GST_ELEMENT(self), pad);
}

static void gst_event_render_class_init(GstEventRenderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  eventrender::install_properties(object_class);

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
  aggregator_class->aggregate = eventrender::aggregate;
  aggregator_class->get_next_time = eventrender::get_next_time;
  aggregator_class->update_src_caps = eventrender::update_src_caps;
  aggregator_class->fixate_src_caps = eventrender::fixate_src_caps;
  aggregator_class->negotiated_src_caps = eventrender::negotiated_src_caps;
  aggregator_class->decide_allocation = eventrender::decide_allocation;
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_event = src_event;
  aggregator_class->src_query = src_query;
  aggregator_class->flush = flush;
  aggregator_class->stop = stop;
}
