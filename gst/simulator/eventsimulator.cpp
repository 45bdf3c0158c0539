// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/eventsimulator.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "gst/base/authors.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/latency.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/played_segment.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/base/types.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/simulator/buffers.hpp"
#include "gst/simulator/caps.hpp"
#include "gst/simulator/properties.hpp"
#include "gst/simulator/stream_simulation.hpp"

GST_DEBUG_CATEGORY(event_simulator_debug);
#define GST_CAT_DEFAULT event_simulator_debug

struct GstEventSimulatorPrivate {
  explicit GstEventSimulatorPrivate(GstEventSimulator* self) : simulation(self) {}

  StreamSimulation simulation;
  std::shared_ptr<void> method_settings;
};

static gpointer parent_class;
static gint private_offset;
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(parent_class)

static GstEventSimulatorPrivate& priv_of(gpointer self) {
  return *static_cast<GstEventSimulatorPrivate*>(G_STRUCT_MEMBER_P(self, private_offset));
}

static StreamSimulation& simulation_of(gpointer self) {
  return priv_of(self).simulation;
}

static const EventSimulatorMethod& method_of(gpointer self) {
  return *GST_EVENT_SIMULATOR_GET_CLASS(self)->method;
}

void* event_simulator_settings(GObject* object) {
  return priv_of(object).method_settings.get();
}

Guarded<SimulatorSettings>& simulator_settings_of(GObject* object) {
  return simulation_of(object).settings;
}

Guarded<SimulatorQos>& simulator_qos_of(GObject* object) {
  return simulation_of(object).timing.qos();
}

void event_simulator_push_interval(GObject* element, Interval interval,
                                   const eventcamera::EventBuckets* events) {
  simulation_of(element).push_interval(std::move(interval), events);
}

void event_simulator_push_finished(GstElement* element) {
  GstPad* pad = GST_BASE_TRANSFORM_SINK_PAD(element);
  GST_PAD_STREAM_LOCK(pad);
  simulation_of(element).push_finished();
  GST_PAD_STREAM_UNLOCK(pad);
}

/* negotiation */

static GstCaps* transform_caps(GstBaseTransform* transform, GstPadDirection direction,
                               GstCaps* caps, GstCaps* filter) {
  const SimulatorVideo& video = method_of(transform).video;
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

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps* out) {
  return simulation_of(transform).set_caps(in, out);
}

/* data, events, queries */

/// Passes on a frame. Output is pushed by the simulator, possibly later.
static GstFlowReturn generate_output(GstBaseTransform* transform, GstBuffer** out) {
  *out = nullptr;
  return simulation_of(transform).take_frame(
      OwnedBuffer(std::exchange(transform->queued_buf, nullptr)));
}

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

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto& simulation = simulation_of(transform);
  if (is_serialized(event) && GST_EVENT_TYPE(event) != GST_EVENT_FLUSH_STOP) simulation.finish();
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_SEGMENT:
      event = segment_of_times(event);
      if (!plays_events(transform, event, "simulate")) return FALSE;
      if (!continues(transform->segment, segment_of(event))) simulation.start_timeline();
      break;
    case GST_EVENT_GAP:
      if (!simulation.take_gap(event)) {
        gst_event_unref(event);
        return TRUE;
      }
      break;
    case GST_EVENT_STREAM_START:
      simulation.start_timeline();
      break;
    case GST_EVENT_FLUSH_START:
      for (auto* companion : simulation.companions()) companion->set_flushing(true);
      break;
    case GST_EVENT_FLUSH_STOP:
      for (auto* companion : simulation.companions()) companion->set_flushing(false);
      simulation.start_timeline();
      break;
    case GST_EVENT_EOS:
      simulation.end();
      break;
    case GST_EVENT_SEGMENT_DONE:
      for (auto* companion : simulation.companions()) companion->end_segment();
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

/// True if a condition holds for the pads of class images and flow that are linked.
template <class Condition>
static bool all_companions(GstBaseTransform* transform, const Condition& condition) {
  return std::ranges::all_of(simulation_of(transform).companions(), [&](auto* companion) {
    const OwnedPad pad = companion->pad();
    return !pad || !gst_pad_is_linked(pad.get()) || condition(pad.get());
  });
}

/// True if a seek can be forwarded. Class images and flow must stay with the video, so none of
/// their upstreams may refuse.
static bool can_seek(GstBaseTransform* transform, const SeekRequest& request) {
  const auto would = [&](GstPad* pad) { return would_seek(pad, request); };
  return all_companions(transform, [](GstPad*) { return false; }) ||
         (would(GST_BASE_TRANSFORM_SINK_PAD(transform)) && all_companions(transform, would));
}

/// Range of the video, if class images and flow can stay with it.
static gboolean answer_seeking(GstBaseTransform* transform, GstQuery* query) {
  if (!PARENT_TRANSFORM_CLASS->query(transform, GST_PAD_SRC, query)) return FALSE;
  GstFormat format = GST_FORMAT_UNDEFINED;
  gboolean seekable = FALSE;
  gint64 start = -1;
  gint64 end = -1;
  gst_query_parse_seeking(query, &format, &seekable, &start, &end);
  const bool all_can = all_companions(transform, [&](GstPad* pad) {
    return format == GST_FORMAT_TIME && peer_can_seek(pad, format);
  });
  gst_query_set_seeking(query, format, all_can ? seekable : FALSE, start, end);
  return TRUE;
}

static gboolean seek(GstBaseTransform* transform, OwnedEvent event) {
  const bool is_alone = all_companions(transform, [](GstPad*) { return false; });
  if (!is_alone && !count_from_start(event, GST_BASE_TRANSFORM_SINK_PAD(transform))) return FALSE;
  const SeekRequest request(event.get());
  if (request.rate() < 0) {
    GST_WARNING_OBJECT(transform,
                       "refused to seek at rate %g: events cannot be simulated backwards",
                       request.rate());
    return FALSE;
  }
  if (!can_seek(transform, request)) {
    GST_WARNING_OBJECT(transform, "an upstream would refuse: refused %" GST_PTR_FORMAT,
                       event.get());
    return FALSE;
  }
  const auto companions = simulation_of(transform).companions();
  for (auto* companion : companions) companion->set_seeking(true);
  for (auto* companion : companions)
    if (const OwnedPad pad = companion->pad())
      gst_pad_push_event(pad.get(), gst_event_ref(event.get()));
  const gboolean done = PARENT_TRANSFORM_CLASS->src_event(transform, event.release());
  for (auto* companion : companions) companion->set_seeking(false);
  return done;
}

static gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    // Not forwarded: only this element skips frames.
    simulation_of(transform).timing.qos().lock()->take_event(transform, event);
    gst_event_unref(event);
    return TRUE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) return seek(transform, OwnedEvent(event));
  return PARENT_TRANSFORM_CLASS->src_event(transform, event);
}

static gboolean query(GstBaseTransform* transform, GstPadDirection direction, GstQuery* query) {
  const bool is_serialized =
      (gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED) != 0;
  if (direction == GST_PAD_SINK && is_serialized) simulation_of(transform).finish();
  if (direction == GST_PAD_SRC && GST_QUERY_TYPE(query) == GST_QUERY_SEEKING)
    return answer_seeking(transform, query);
  if (direction != GST_PAD_SRC || GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
    return PARENT_TRANSFORM_CLASS->query(transform, direction, query);

  const GstClockTime latency = simulation_of(transform).timing.latency();
  return answer_latency(GST_CAT_DEFAULT, GST_BASE_TRANSFORM_SINK_PAD(transform), query, latency);
}

static GstPad* request_new_pad(GstElement* element, GstPadTemplate* pad_template, const gchar*,
                               const GstCaps*) {
  auto& simulation = simulation_of(element);
  const bool is_of_labels =
      g_strcmp0(GST_PAD_TEMPLATE_NAME_TEMPLATE(pad_template), "label_sink") == 0;
  if (is_of_labels) return simulation.class_images.add_to(element, pad_template);
  return simulation.flow_tensors.add_to(element, pad_template);
}

static void release_pad(GstElement* element, GstPad* pad) {
  for (auto* companion : simulation_of(element).companions())
    if (companion->pad().get() == pad) companion->remove_from(element, pad);
}

/// Ends the waiting of threads before their pads are deactivated.
static GstStateChangeReturn change_state(GstElement* element, GstStateChange change) {
  for (auto* companion : simulation_of(element).companions()) {
    if (change == GST_STATE_CHANGE_READY_TO_PAUSED) companion->start();
    if (change == GST_STATE_CHANGE_PAUSED_TO_READY) companion->stop();
  }
  return GST_ELEMENT_CLASS(parent_class)->change_state(element, change);
}

static gboolean start(GstBaseTransform* transform) {
  if (const auto fault_of = method_of(transform).fault) {
    if (const auto fault = fault_of(G_OBJECT(transform)); !fault.empty()) {
      GST_ELEMENT_ERROR(transform, RESOURCE, SETTINGS, ("%s", fault.c_str()), (nullptr));
      return FALSE;
    }
  }
  const auto qos = simulation_of(transform).timing.qos().lock();
  qos->start_over();
  qos->reset_stats();
  return TRUE;
}

static gboolean stop(GstBaseTransform* transform) {
  GstPad* pad = GST_BASE_TRANSFORM_SINK_PAD(transform);
  GST_PAD_STREAM_LOCK(pad);  // see event_simulator_push_finished()
  simulation_of(transform).reset();
  GST_PAD_STREAM_UNLOCK(pad);
  simulation_of(transform).timing.reset();
  return TRUE;
}

/* type */

/// Makes the method's settings here, because the method is not yet known in init.
static void constructed(GObject* object) {
  const auto& method = method_of(object);
  if (method.threshold) {
    const auto settings = simulation_of(object).settings.lock();
    settings->simulation.positive_threshold = *method.threshold;
    settings->simulation.negative_threshold = *method.threshold;
  }
  if (method.make_settings != nullptr) priv_of(object).method_settings = method.make_settings();
  G_OBJECT_CLASS(parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(object));
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
