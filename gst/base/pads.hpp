// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <tuple>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"

/// Name of a custom query that simulators answer: the events come from video.
inline constexpr char simulated_query[] = "event-simulated";

/// True if the events of a sink pad are simulated, not recorded.
inline bool is_simulated(GstPad* sink) {
  GstQuery* const query =
      gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty(simulated_query));
  const bool is = gst_pad_peer_query(sink, query) != FALSE;
  gst_query_unref(query);
  return is;
}

/// For class_init: adds a pad template. GstAggregator requires pads of GST_TYPE_AGGREGATOR_PAD.
inline void add_pad_template(GstElementClass* klass, const char* name, GstPadDirection direction,
                             const OwnedCaps& caps, GstPadPresence presence = GST_PAD_ALWAYS,
                             GType type = GST_TYPE_PAD) {
  gst_element_class_add_pad_template(
      klass, gst_pad_template_new_with_gtype(name, direction, presence, caps.get(), type));
}
inline void add_pad_template(GstElementClass* klass, const char* name, GstPadDirection direction,
                             const char* caps, GstPadPresence presence = GST_PAD_ALWAYS,
                             GType type = GST_TYPE_PAD) {
  add_pad_template(klass, name, direction, OwnedCaps(gst_caps_from_string(caps)), presence, type);
}

/// For class_init: adds the templates of the always pads "sink" and "src".
inline void add_pad_templates(GstElementClass* klass, const char* sink_caps, const char* src_caps) {
  add_pad_template(klass, "sink", GST_PAD_SINK, sink_caps);
  add_pad_template(klass, "src", GST_PAD_SRC, src_caps);
}

/// For init: adds the pad of the template `name`.
inline GstPad* add_pad(GstElement* element, const char* name) {
  auto* pad_template = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(element), name);
  GstPad* const pad = gst_pad_new_from_template(pad_template, name);
  gst_element_add_pad(element, pad);
  return pad;
}

/// An element that decides the caps of its output, with the pads "sink" and "src".
struct ElementPads {
  GstElement* const element;
  GstPad* const sink = add_pad(element, "sink");
  GstPad* const src = add_pad(element, "src");

  ElementPads(GstElement* of, GstPadChainFunction chain, GstPadEventFunction sink_event)
      : element(of) {
    gst_pad_set_chain_function(sink, chain);
    gst_pad_set_event_function(sink, sink_event);
    gst_pad_use_fixed_caps(src);
  }
};

/// True if the peer of a pad can seek in this format.
inline bool peer_can_seek(GstPad* pad, GstFormat format) {
  GstQuery* const query = gst_query_new_seeking(format);
  gboolean seekable = FALSE;
  if (gst_pad_peer_query(pad, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  return seekable != FALSE;
}

/// GST_EVENT_IS_SERIALIZED() without its warning about mixed enumerations.
inline bool is_serialized(GstEvent* event) {
  return (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) != 0;
}

/// Pushes an event; if it is refused, returns the last flow return of the pad.
inline GstFlowReturn push_event(GstPad* src, GstEvent* event) {
  return gst_pad_push_event(src, event) ? GST_FLOW_OK : gst_pad_get_last_flow_return(src);
}

/// Answers a latency query on a source pad: upstream's latency plus the element's own.
inline gboolean answer_latency(GstPad* sink, GstQuery* query, GstClockTime own) {
  if (!gst_pad_peer_query(sink, query)) return FALSE;
  gboolean live = FALSE;
  GstClockTime min = 0;
  GstClockTime max = 0;
  gst_query_parse_latency(query, &live, &min, &max);
  gst_query_set_latency(query, live, min + own,
                        GST_CLOCK_TIME_IS_VALID(max) ? max + own : GST_CLOCK_TIME_NONE);
  return TRUE;
}

/// For init: makes a source pad answer latency queries: `latency_of(element)` is the own latency.
template <auto latency_of>
void answer_latency_queries(GstPad* src) {
  gst_pad_set_query_function(
      src, +[](GstPad* pad, GstObject* element, GstQuery* query) {
        if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
          return gst_pad_query_default(pad, element, query);
        const OwnedPad sink(gst_element_get_static_pad(GST_ELEMENT(element), "sink"));
        return answer_latency(sink.get(), query, latency_of(element));
      });
}

/// Says that the latency of an element may have changed.
inline void post_latency(gpointer element) {
  gst_element_post_message(GST_ELEMENT(element), gst_message_new_latency(GST_OBJECT(element)));
}

/// For init: posts a latency message whenever the property max-latency is set.
inline void announce_max_latency(gpointer element) {
  const auto post = +[](GstElement* changed, GParamSpec*, gpointer) { post_latency(changed); };
  g_signal_connect(element, "notify::max-latency", G_CALLBACK(post), nullptr);
}

/// Caps of a CAPS event, which owns them.
inline GstCaps* caps_of(GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  return caps;
}

/// Segment of a SEGMENT event, which owns it.
inline const GstSegment& segment_of(GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  return *segment;
}

/// True if both segments give a timestamp the same running time and the same stream time.
inline bool continues(const GstSegment& current, const GstSegment& next) {
  const guint64 position = current.start > next.start ? current.start : next.start;
  const auto times = [&](const GstSegment& segment) {
    guint64 running = 0;
    guint64 stream = 0;
    const gint running_sign =
        gst_segment_to_running_time_full(&segment, segment.format, position, &running);
    const gint stream_sign =
        gst_segment_to_stream_time_full(&segment, segment.format, position, &stream);
    return std::tuple(segment.format, segment.rate, running_sign, running, stream_sign, stream);
  };
  return times(current) == times(next);
}

/// Posts an error message about a SEGMENT event, which it unrefs. Returns false.
inline bool refuse_segment(gpointer element, GstEvent* event, const Report& report) {
  gchar* const cause = gst_info_strdup_printf("segment %" GST_SEGMENT_FORMAT, &segment_of(event));
  post_message(element, GST_MESSAGE_ERROR, report, cause);
  g_free(cause);
  gst_event_unref(event);
  return false;
}

/// True if a SEGMENT event has a positive rate. Otherwise posts an error message of `element` and
/// unrefs the event. `verb` is what the element does with events, such as "merge".
inline bool plays_forwards(gpointer element, GstEvent* event, const char* verb) {
  return segment_of(event).rate > 0 ||
         refuse_segment(
             element, event,
             {GST_STREAM_ERROR_FAILED,
              std::string("Cannot ") + verb + " events backwards; play at a positive rate."});
}

/// Property of decodebin to get events: are_final_caps() of gstdecodebin2.c stops at these caps.
#define ASK_FOR_EVENTS "caps=\"application/x-event-camera,format=XYTP\""

/// Like plays_forwards(), and also requires a segment in time format.
inline bool plays_events(gpointer element, GstEvent* event, const char* verb) {
  const GstFormat format = segment_of(event).format;
  if (format == GST_FORMAT_TIME) return plays_forwards(element, event, verb);
  return refuse_segment(
      element, event,
      {GST_STREAM_ERROR_FORMAT, std::string("Cannot ") + verb + " " + gst_format_get_name(format) +
                                    ": this stream has no timestamps. Insert a reader of event "
                                    "files upstream, such as decodebin " ASK_FOR_EVENTS "."});
}
