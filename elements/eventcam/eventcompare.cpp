// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcompare
 * @title: eventcompare
 * @short_description: measures how alike two streams of events are
 *
 * Compares the stream on the pad `candidate`, which it passes through, with the one on the pad
 * `reference`, over the time that both cover: from where the later one begins to where the first
 * one ends. The two are held together by their stream times, and must be of sensors of one size.
 * At EOS of the candidate, or where it is stopped before, it posts an element message
 * `eventcompare`:
 *
 * - `start`, `end` (#gint64): the time that both cover, in stream time (ns);
 * - `reference`, `candidate` (#GstStructure): the figures of either, as #GstEventStats has them;
 * - `map-correlation` (#gdouble): Pearson's, of the events of each pixel;
 * - `reference-partners`, `candidate-partners` (#GstStructure): the shares of the events of either
 *   stream that have a partner in the other, of the same polarity, at the same pixel or next to it
 *   (#gdouble, `within-1ms`, `within-5ms`, `within-10ms`);
 * - `rate-curve` (#GstStructure): how many events there are in bins of `bin` ns (#guint64), as
 *   arrays `reference` and `candidate`.
 *
 * The same is written to #GstEventCompare:location as JSON, and to #GstEventCompare:map a picture
 * of the events of each pixel: of the reference, of the candidate and, in blue where the candidate
 * has more and in red where it has fewer, their difference.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 eventcompare name=compare location=figures.json ! fakesink  filesrc
 * location=real.raw ! evtdec ! compare.reference  filesrc location=drive.mp4 ! decodebin !
 * eventsim-dense ! compare.candidate
 * ]|
 */
#include <gst/base/gstaggregator.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <utility>

#include "elements/eventcam/aggregator_pads.hpp"
#include "elements/eventcam/aggregator_seeking.hpp"
#include "elements/eventcam/broken_events.hpp"
#include "elements/eventcam/report.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/measure/map_picture.hpp"
#include "src/measure/stream_comparison.hpp"

GST_DEBUG_CATEGORY_STATIC(event_compare_debug);
#define GST_CAT_DEFAULT event_compare_debug

using eventcamera::both_sides;
using eventcamera::Nanoseconds;
using eventcamera::OfSides;
using eventcamera::Side;
using eventcamera::StreamComparison;

namespace {

enum Property {
  prop_0,
  prop_location,
  prop_map,
};

/// A sensor's size.
struct Sensor {
  int width;
  int height;

  friend bool operator==(const Sensor&, const Sensor&) = default;
};

struct Private {
  std::mutex mutex;  // guards what follows; nothing is called under it
  ReportPlaces places;

  // Set at init.
  OfSides<GstAggregatorPad*> pads;

  // The source pad's thread's, or nobody's while there is none.
  OfSides<std::optional<Sensor>> sensors;
  OwnedCaps candidate_caps;
  std::optional<StreamComparison> comparison;  // once both sensors are known
  bool concluded = true;  // there are no events in it that figures do not tell of
  BrokenEvents broken{"not compared"};
};

struct GstEventCompare {
  GstAggregator parent;
  Private* priv;
};

struct GstEventCompareClass {
  GstAggregatorClass parent_class;
};

GstEventCompare* event_compare(gpointer object) {
  return static_cast<GstEventCompare*>(object);
}

const char* name_of(Side side) {
  return side == Side::reference ? "reference" : "candidate";
}

}  // namespace

G_DEFINE_TYPE_WITH_CODE(GstEventCompare, gst_event_compare, GST_TYPE_AGGREGATOR,
                        GST_DEBUG_CATEGORY_INIT(event_compare_debug, "eventcompare", 0,
                                                "how alike two streams of events are"))
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_compare_parent_class)
GST_ELEMENT_REGISTER_DEFINE(eventcompare, "eventcompare", GST_RANK_NONE,
                            gst_event_compare_get_type())

/* properties */

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto& priv = *event_compare(object)->priv;
  const gchar* text = g_value_get_string(value);
  const std::string path = text != nullptr ? text : "";
  const std::lock_guard lock(priv.mutex);
  switch (id) {
    case prop_location:
      priv.places.location = path;
      break;
    case prop_map:
      priv.places.map = path;
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto& priv = *event_compare(object)->priv;
  const std::lock_guard lock(priv.mutex);
  switch (id) {
    case prop_location:
      g_value_set_string(value, priv.places.location.c_str());
      break;
    case prop_map:
      g_value_set_string(value, priv.places.map.c_str());
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static ReportPlaces places_of(GstEventCompare* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->places;
}

/* figures */

/// Moves a structure into a field of another.
static void put_structure(GstStructure* structure, const char* field, GstStructure* value) {
  gst_structure_set(structure, field, GST_TYPE_STRUCTURE, value, nullptr);
  gst_structure_free(value);
}

static GstStructure* partners_of(const std::array<double, 3>& shares) {
  return gst_structure_new("partners", "within-1ms", G_TYPE_DOUBLE, shares[0], "within-5ms",
                           G_TYPE_DOUBLE, shares[1], "within-10ms", G_TYPE_DOUBLE, shares[2],
                           nullptr);
}

static GstStructure* curve_of(const eventcamera::RateCurve& rates) {
  GstStructure* curve =
      gst_structure_new("rate-curve", "bin", G_TYPE_UINT64,
                        static_cast<guint64>(rates.bin_length()) * GST_USECOND, nullptr);
  for (const auto side : both_sides) {
    GValue counts = G_VALUE_INIT;
    g_value_init(&counts, GST_TYPE_ARRAY);
    for (const auto& bin : rates.bins()) {
      GValue count = G_VALUE_INIT;
      g_value_init(&count, G_TYPE_UINT64);
      g_value_set_uint64(&count, bin[side]);
      gst_value_array_append_and_take_value(&counts, &count);
    }
    gst_structure_take_value(curve, name_of(side), &counts);
  }
  return curve;
}

static GstStructure* structure_of(const StreamComparison& comparison) {
  const auto figures = comparison.figures();
  GstStructure* structure =
      gst_structure_new("eventcompare", "start", G_TYPE_INT64, gint64{figures.start}, "end",
                        G_TYPE_INT64, gint64{figures.end}, nullptr);
  for (const auto side : both_sides) {
    GstStructure* stream = gst_structure_new_empty(name_of(side));
    put_figures(stream, figures.streams[side]);
    put_structure(structure, name_of(side), stream);
  }
  gst_structure_set(structure, "map-correlation", G_TYPE_DOUBLE, figures.map_correlation, nullptr);
  put_structure(structure, "reference-partners",
                partners_of(figures.partner_shares[Side::reference]));
  put_structure(structure, "candidate-partners",
                partners_of(figures.partner_shares[Side::candidate]));
  put_structure(structure, "rate-curve", curve_of(comparison.rates()));
  return structure;
}

/// Tells and writes what has come out. What never began to be compared is a comparison without
/// events.
static void conclude(GstEventCompare* self) {
  self->priv->concluded = true;
  const StreamComparison nothing(1, 1);
  const auto& comparison = self->priv->comparison ? *self->priv->comparison : nothing;
  report(self, places_of(self), structure_of(comparison), [&] {
    return eventcamera::draw_maps(comparison.map(Side::reference), comparison.map(Side::candidate));
  });
}

/* events */

static Nanoseconds stream_time(GstAggregatorPad* pad, GstClockTime time) {
  guint64 result = time;
  GST_OBJECT_LOCK(pad);
  const gint sign = gst_segment_to_stream_time_full(&pad->segment, GST_FORMAT_TIME, time, &result);
  GST_OBJECT_UNLOCK(pad);
  const auto magnitude = static_cast<Nanoseconds>(std::min<guint64>(result, G_MAXINT64));
  return sign < 0 ? -magnitude : magnitude;
}

/// Takes a buffer into the comparison. May throw.
static void compare(GstEventCompare* self, Side side, GstBuffer* buffer) {
  auto& priv = *self->priv;
  const auto interval = interval_of(buffer);
  const MappedEvents mapped(buffer);
  if (!interval || !mapped) {
    priv.broken.warn(self,
                     interval ? "a buffer is no whole number of events" : "a buffer has no PTS");
    return;
  }
  if (!mapped.events().empty()) priv.concluded = false;
  const auto left_out =
      priv.comparison->add(side, mapped.events(), stream_time(priv.pads[side], interval->start),
                           stream_time(priv.pads[side], interval->end));
  if (left_out > 0) priv.broken.warn(self, "some lie beyond the sensor");
}

static bool over(GstAggregatorPad* pad) {
  return gst_aggregator_pad_is_eos(pad) && !gst_aggregator_pad_has_buffer(pad);
}

/// Whether there is anything to compare, now that caps have come. May throw.
static bool begin(GstEventCompare* self) {
  auto& priv = *self->priv;
  const auto& reference = priv.sensors[Side::reference];
  const auto& candidate = priv.sensors[Side::candidate];
  if (!reference || !candidate || *reference != *candidate) return false;
  if (!priv.comparison) {
    priv.comparison.emplace(reference->width, reference->height);
    priv.concluded = true;
  }
  return true;
}

/// Takes what comes next of either side. May throw.
static GstFlowReturn take_next(GstEventCompare* self) {
  auto& priv = *self->priv;
  auto* reference_pad = priv.pads[Side::reference];
  auto* candidate_pad = priv.pads[Side::candidate];
  const bool comparing = begin(self);
  const auto behind = comparing ? priv.comparison->behind() : Side::candidate;
  if (behind == Side::reference && !over(reference_pad)) {
    GstBuffer* buffer = gst_aggregator_pad_pop_buffer(reference_pad);
    if (buffer == nullptr) return GST_AGGREGATOR_FLOW_NEED_DATA;
    const OwnedBuffer owned(buffer);
    compare(self, Side::reference, buffer);
    return GST_FLOW_OK;
  }
  GstBuffer* buffer = gst_aggregator_pad_peek_buffer(candidate_pad);
  if (buffer == nullptr) return GST_AGGREGATOR_FLOW_NEED_DATA;
  {
    const OwnedBuffer owned(buffer);
    if (comparing && behind == Side::candidate) compare(self, Side::candidate, buffer);
  }
  return gst_aggregator_finish_buffer(GST_AGGREGATOR(self),
                                      gst_aggregator_pad_pop_buffer(candidate_pad));
}

static GstFlowReturn aggregate(GstAggregator* aggregator, gboolean) {
  auto* self = event_compare(aggregator);
  auto& priv = *self->priv;
  if (over(priv.pads[Side::candidate])) {
    conclude(self);
    return GST_FLOW_EOS;
  }
  const auto& reference = priv.sensors[Side::reference];
  const auto& candidate = priv.sensors[Side::candidate];
  if (reference && candidate && *reference != *candidate) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("Only streams of sensors of one size can be compared; the reference has "
                       "%d x %d pixels, the candidate %d x %d.",
                       reference->width, reference->height, candidate->width, candidate->height),
                      (nullptr));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  try {
    return take_next(self);
  } catch (const std::bad_alloc&) {
    priv.comparison.reset();
    GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                      ("There is not enough memory to compare these events."), (nullptr));
    return GST_FLOW_ERROR;
  }
}

/* negotiation */

static GstFlowReturn update_src_caps(GstAggregator* aggregator, GstCaps*, GstCaps** result) {
  const auto& priv = *event_compare(aggregator)->priv;
  if (!priv.candidate_caps) return GST_AGGREGATOR_FLOW_NEED_DATA;
  *result = gst_caps_ref(priv.candidate_caps.get());
  return GST_FLOW_OK;
}

static bool take_caps(GstEventCompare* self, Side side, GstCaps* caps) {
  auto& priv = *self->priv;
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) return false;
  const Sensor sensor{info.width, info.height};
  if (priv.sensors[side] != sensor) priv.comparison.reset();
  priv.sensors[side] = sensor;
  if (side == Side::candidate) {
    priv.candidate_caps.reset(gst_caps_ref(caps));
    gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(self));
  }
  return true;
}

/// The candidate goes on as it comes, so downstream must take what upstream makes.
static gboolean sink_query(GstAggregator* aggregator, GstAggregatorPad* pad, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_CAPS ||
      pad != event_compare(aggregator)->priv->pads[Side::candidate])
    return PARENT_AGGREGATOR_CLASS->sink_query(aggregator, pad, query);
  answer_caps_of_passed(aggregator, pad, query);
  return TRUE;
}

/* events, states */

static bool take_segment(GstEventCompare* self, Side side, GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  if (!plays_forwards(self, *segment, "compared")) return false;
  if (side == Side::candidate) gst_aggregator_update_segment(GST_AGGREGATOR(self), segment);
  return true;
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  auto* self = event_compare(aggregator);
  const auto side = pad == self->priv->pads[Side::reference] ? Side::reference : Side::candidate;
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    const bool taken = take_caps(self, side, caps);
    gst_event_unref(event);
    return taken ? TRUE : FALSE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !take_segment(self, side, event)) {
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_event(GstAggregator* aggregator, GstEvent* event) {
  auto* self = event_compare(aggregator);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) {
    for (GstAggregatorPad* pad :
         {self->priv->pads[Side::reference], self->priv->pads[Side::candidate]}) {
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
    return answer_seeking(event_compare(aggregator)->priv->pads[Side::candidate], query);
  return PARENT_AGGREGATOR_CLASS->src_query(aggregator, query);
}

static GstFlowReturn flush(GstAggregator* aggregator) {
  event_compare(aggregator)->priv->comparison.reset();
  return GST_FLOW_OK;
}

static gboolean start(GstAggregator* aggregator) {
  auto* self = event_compare(aggregator);
  return can_report(self, places_of(self)) ? TRUE : FALSE;
}

static gboolean stop(GstAggregator* aggregator) {
  auto* self = event_compare(aggregator);
  auto& priv = *self->priv;
  if (priv.comparison && !priv.concluded) conclude(self);
  priv.comparison.reset();
  priv.candidate_caps.reset();
  priv.sensors = {};
  priv.broken.begin_anew();
  return TRUE;
}

/* type */

static void finalize(GObject* object) {
  delete event_compare(object)->priv;
  G_OBJECT_CLASS(gst_event_compare_parent_class)->finalize(object);
}

static void gst_event_compare_init(GstEventCompare* self) {
  self->priv = new Private;
  for (const auto side : both_sides) self->priv->pads[side] = add_sink_pad(self, name_of(side));
}

static void gst_event_compare_class_init(GstEventCompareClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;

  constexpr auto flags = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                  GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      object_class, prop_location,
      g_param_spec_string(
          "location", "Location",
          "Where the figures are written as JSON, at EOS or where it is stopped before", "",
          flags));
  g_object_class_install_property(
      object_class, prop_map,
      g_param_spec_string("map", "Map",
                          "Where a picture of the events of each pixel, of both and of their "
                          "difference, is written as PNG, at EOS or where it is stopped before",
                          "", flags));

#define COMPARED_CAPS         \
  GST_EVENT_CAMERA_MEDIA_TYPE \
  ", format = (string) XYTP, width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ]"
  static GstStaticPadTemplate reference_template = GST_STATIC_PAD_TEMPLATE(
      "reference", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(COMPARED_CAPS));
  static GstStaticPadTemplate candidate_template = GST_STATIC_PAD_TEMPLATE(
      "candidate", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(COMPARED_CAPS));
  static GstStaticPadTemplate src_template =
      GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(COMPARED_CAPS));
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  for (auto* pad_template : {&reference_template, &candidate_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype(element_class, pad_template,
                                                         GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata(element_class, "Event comparison", "Filter/Analyzer",
                                        "Measures how alike two streams of events are",
                                        "gst-eventsim");

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->aggregate = aggregate;
  aggregator_class->update_src_caps = update_src_caps;
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_event = src_event;
  aggregator_class->src_query = src_query;
  aggregator_class->sink_query = sink_query;
  aggregator_class->flush = flush;
  aggregator_class->start = start;
  aggregator_class->stop = stop;
}
