// SPDX-License-Identifier: LGPL-2.1-or-later

#include "gst/base/element_type.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/simulator/simulation.hpp"

GST_DEBUG_CATEGORY(event_simulator_debug);
#define GST_CAT_DEFAULT event_simulator_debug

struct GstEventSimulatorPrivate {
  explicit GstEventSimulatorPrivate(GstEventSimulator* self) : simulation(self) {}

  Simulation simulation;
  std::atomic<bool> is_qos_set = false;  ///< by the application
  std::shared_ptr<void> method_settings;
};

static gpointer parent_class;
static gint private_offset;
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(parent_class)

static GstEventSimulatorPrivate& priv_of(gpointer self) {
  return *static_cast<GstEventSimulatorPrivate*>(G_STRUCT_MEMBER_P(self, private_offset));
}

static Simulation& simulation_of(gpointer self) {
  return priv_of(self).simulation;
}

static const EventSimulatorMethod& method_of(gpointer self) {
  return *GST_EVENT_SIMULATOR_GET_CLASS(self)->method;
}

void* event_simulator_settings(GObject* object) {
  return priv_of(object).method_settings.get();
}

static GstCaps* transform_caps(GstBaseTransform* transform, GstPadDirection direction,
                               GstCaps* caps, GstCaps* filter) {
  const SimulatorVideo& video = method_of(transform).video;
  GstCaps* other = direction == GST_PAD_SINK ? video.output_caps(caps) : video.input_caps(caps);
  if (filter == nullptr) return other;
  GstCaps* filtered = gst_caps_intersect_full(filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(other);
  return filtered;
}

/// Fixates the output to events if the caps include them, else to video.
static GstCaps* fixate_caps(GstBaseTransform*, GstPadDirection direction, GstCaps*,
                            GstCaps* other) {
  if (direction == GST_PAD_SRC || gst_caps_is_empty(other)) return gst_caps_fixate(other);
  guint chosen = 0;
  for (guint i = gst_caps_get_size(other); i-- > 0;)
    if (gst_structure_has_name(gst_caps_get_structure(other, i), GST_EVENT_CAMERA_MEDIA_TYPE))
      chosen = i;
  GstCaps* const fixed = gst_caps_copy_nth(other, chosen);
  gst_caps_unref(other);
  return gst_caps_fixate(fixed);
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps* out) {
  if (!simulation_of(transform).set_caps(in, out)) return FALSE;
  // Skipped frames make the view of events recent, and a recording of events worse.
  if (!priv_of(transform).is_qos_set)
    gst_base_transform_set_qos_enabled(transform, event_simulator_draws(out));
  return TRUE;
}

static gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE,
                                nullptr);  // any stride is supported
  GstAllocationParams params;
  gst_allocation_params_init(&params);
  params.align = 63;  // vectors of pixels do not straddle cache lines
  gst_query_add_allocation_param(query, nullptr, &params);
  GstCaps* caps = nullptr;
  GstVideoInfo video;
  gst_query_parse_allocation(query, &caps, nullptr);
  if (caps != nullptr && gst_video_info_from_caps(&video, caps))  // the last frame may be held
    gst_query_add_allocation_pool(query, nullptr, static_cast<guint>(GST_VIDEO_INFO_SIZE(&video)),
                                  2, 0);
  return PARENT_TRANSFORM_CLASS->propose_allocation(transform, decide, query);
}

/// Always uses a GstEventPool, because downstream's pools have buffers of a fixed size.
static void decide_on_event_pool(GstQuery* query) {
  while (gst_query_get_n_allocation_pools(query) > 0)
    gst_query_remove_nth_allocation_pool(query, 0);
  auto* pool = event_pool_new();
  gst_query_add_allocation_pool(query, pool, 0, 0, 0);
  gst_object_unref(pool);
}

static gboolean decide_allocation(GstBaseTransform* transform, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  if (!event_simulator_draws(caps))
    decide_on_event_pool(query);
  else if (!decide_on_drawn_pool(query, caps, 1))  // the last picture
    return FALSE;
  return PARENT_TRANSFORM_CLASS->decide_allocation(transform, query);
}

static gboolean transform_size(GstBaseTransform*, GstPadDirection direction, GstCaps*, gsize,
                               GstCaps* other, gsize* other_size) {
  GstVideoInfo drawn;
  if (direction != GST_PAD_SINK || !event_simulator_draws(other) ||
      !gst_video_info_from_caps(&drawn, other))
    return FALSE;
  *other_size = GST_VIDEO_INFO_SIZE(&drawn);
  return TRUE;
}

GstFlowReturn event_simulator_prepare_buffer(GstBaseTransform* element, GstBuffer* in,
                                             GstBuffer** out) {
  return PARENT_TRANSFORM_CLASS->prepare_output_buffer(element, in, out);
}

/// Takes a frame, unless GstBaseTransform skips it for QoS: then the next interval is longer.
static GstFlowReturn submit_input_buffer(GstBaseTransform* transform, gboolean is_discont,
                                         GstBuffer* frame) {
  auto& simulation = simulation_of(transform);
  const GstClockTime pts = GST_BUFFER_PTS(frame);
  if (GST_BUFFER_IS_DISCONT(frame)) simulation.interrupt(pts);
  const GstFlowReturn result =
      PARENT_TRANSFORM_CLASS->submit_input_buffer(transform, is_discont, frame);
  if (result == GST_BASE_TRANSFORM_FLOW_DROPPED) simulation.skip_frame(pts);
  return result;
}

/// Simulates the frame that was submitted. The simulation pushes its output, which can be a buffer,
/// a GAP, or several of both.
static GstFlowReturn generate_output(GstBaseTransform* transform, GstBuffer** out) {
  *out = nullptr;
  OwnedBuffer frame(std::exchange(transform->queued_buf, nullptr));
  return frame ? simulation_of(transform).push_frame(std::move(frame)) : GST_FLOW_OK;
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
      if (!continues(transform->segment, segment_of(event))) {
        simulation.end();
        simulation.start_timeline();
      }
      break;
    case GST_EVENT_GAP:
      if (simulation.hold_through(event)) {
        gst_event_unref(event);
        return TRUE;
      }
      break;
    case GST_EVENT_TAG:
      simulation.check_orientation(event);
      break;
    case GST_EVENT_STREAM_START:
      simulation.end();
      simulation.start_timeline();
      break;
    case GST_EVENT_FLUSH_STOP:
      simulation.start_timeline();
      break;
    case GST_EVENT_EOS:
    case GST_EVENT_SEGMENT_DONE:
      simulation.end();
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

/// Skips the frames that would be late as well. As GstVideoDecoder does: after a late picture, also
/// the frames that came in during the time lost, so that the next one has time to spare; but no
/// frame that has not come yet, because that has not waited. The event is not forwarded: only this
/// element skips frames.
static void handle_qos(GstBaseTransform* transform, GstEvent* event) {
  GstQOSType type = GST_QOS_TYPE_UNDERFLOW;
  gdouble proportion = 1;
  GstClockTimeDiff late = 0;
  GstClockTime time = GST_CLOCK_TIME_NONE;
  gst_event_parse_qos(event, &type, &proportion, &late, &time);
  gst_event_unref(event);
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(transform));
  if (time > G_MAXINT64 || late > G_MAXINT64 / 4) return;
  if (late > 0 && type != GST_QOS_TYPE_THROTTLE) {
    const auto interval = static_cast<GstClockTimeDiff>(simulation_of(transform).interval());
    const auto waited = now > time && now < G_MAXINT64 ? GST_CLOCK_DIFF(time, now) : G_MAXINT64;
    late = std::max(late, std::min(2 * late + interval, waited));
  }
  gst_base_transform_update_qos(transform, proportion, late, time);
}

static gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    handle_qos(transform, event);
    return TRUE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && SeekRequest(event).rate() < 0) {
    GST_WARNING_OBJECT(transform,
                       "refused %" GST_PTR_FORMAT ": events cannot be simulated backwards", event);
    gst_event_unref(event);
    return FALSE;
  }
  return PARENT_TRANSFORM_CLASS->src_event(transform, event);
}

static gboolean query(GstBaseTransform* transform, GstPadDirection direction, GstQuery* query) {
  const bool is_serialized =
      (gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED) != 0;
  if (direction == GST_PAD_SINK && is_serialized) simulation_of(transform).finish();
  if (direction == GST_PAD_SRC && GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM &&
      gst_structure_has_name(gst_query_get_structure(query), simulated_query))
    return TRUE;
  if (direction == GST_PAD_SRC && GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return answer_latency(GST_BASE_TRANSFORM_SINK_PAD(transform), query,
                          simulation_of(transform).latency());
  return PARENT_TRANSFORM_CLASS->query(transform, direction, query);
}

static gboolean start(GstBaseTransform* transform) {
  if (const auto fault_of = method_of(transform).fault) {
    if (const auto fault = fault_of(G_OBJECT(transform)); !fault.empty()) {
      GST_ELEMENT_ERROR(transform, RESOURCE, SETTINGS, ("%s", fault.c_str()), (nullptr));
      return FALSE;
    }
  }
  *simulation_of(transform).stats.lock() = {};
  return TRUE;
}

static gboolean stop(GstBaseTransform* transform) {
  simulation_of(transform).reset();
  return TRUE;
}

static Guarded<SimulatorSettings>& settings_of(GObject* object) {
  return simulation_of(object).settings;
}

static SimulatorSettings defaults_of(const EventSimulatorMethod& method) {
  SimulatorSettings defaults;
  if (method.threshold) {
    defaults.simulation.positive_threshold = *method.threshold;
    defaults.simulation.negative_threshold = *method.threshold;
  }
  return defaults;
}

/// A member of SimulatorSettings::simulation.
template <auto member>
static auto& simulation(SimulatorSettings& settings) {
  return settings.simulation.*member;
}

const char* const denoise_blurb =
    "Remove camera noise from each frame first: smooth differences between neighbouring pixels of "
    "up to this size, and keep larger ones such as edges (grey levels, white is 255; 0 = off, "
    "-1 = automatic: four standard deviations of the noise, found where successive frames differ "
    "least)";

static void install_method_properties(GObjectClass* klass, const EventSimulatorMethod& method) {
  Properties<settings_of> properties(klass, defaults_of(method));
  if (method.threshold) {
    properties.add_controllable(simulation<&eventcamera::Settings::positive_threshold>,
                                "positive-threshold",
                                "Contrast threshold of ON events: brightness must rise by more "
                                "than this (8-bit grey levels at any bit depth)",
                                0, 255);
    properties.add_controllable(simulation<&eventcamera::Settings::negative_threshold>,
                                "negative-threshold",
                                "Contrast threshold of OFF events: brightness must fall by more "
                                "than this (8-bit grey levels at any bit depth, a magnitude)",
                                0, 255);
  }
  if (method.denoises)
    properties.add_controllable(simulation<&eventcamera::Settings::denoise>, "denoise",
                                denoise_blurb, eventcamera::automatic_denoise, 255);
  if (method.interpolates)
    properties.add(simulation<&eventcamera::Settings::interpolated_frames>, "interpolated-frames",
                   "Number of frames to interpolate between two frames of the video; events take "
                   "those frames' timestamps (at most one frame per microsecond)",
                   0, 255);
  if (method.labels)
    properties.add(simulation<&eventcamera::Settings::labels>, "label",
                   "Label each event with its cause: light, leak, shot noise, hot pixel or "
                   "exposure pulse. Events drawn as video have no labels");
  if (method.has_flow)
    properties.add(&SimulatorSettings::write_flow, "write-flow",
                   "Add the optical flow of each interval to its buffer of events, as a "
                   "GstEventCameraFlowMeta: the motion of each pixel from the start of the buffer "
                   "to its end. Events drawn as video have none");
  if (method.install_properties != nullptr) method.install_properties(klass);
}

static void set_qos(GObject* object, const GValue* value) {
  priv_of(object).is_qos_set = true;
  gst_base_transform_set_qos_enabled(GST_BASE_TRANSFORM(object), g_value_get_boolean(value));
}

static void get_qos(GObject* object, GValue* value) {
  g_value_set_boolean(value, gst_base_transform_is_qos_enabled(GST_BASE_TRANSFORM(object)));
}

static GstStructure* stats_of(GObject* object) {
  const auto stats = simulation_of(object).stats.copy();
  return new_counters("application/x-event-simulator-stats",
                      {{"frames", stats.frames},
                       {"skipped-frames", stats.skipped_frames},
                       {"repeated-frames", stats.repeated_frames},
                       {"processing-time", stats.processing_time}});
}

static void install_base_properties(GObjectClass* klass) {
  Properties<settings_of> properties(klass);
  properties.add(simulation<&eventcamera::Settings::threads>, "n-threads",
                 "Maximum number of threads (0 = one per processor); the events do not depend on "
                 "it",
                 0, G_MAXINT);
  properties.add(&SimulatorSettings::palette, "palette",
                 "Colours of event frames (accumulated-event video)", palette_type());
  properties.add(&SimulatorSettings::skip_repeated, "skip-repeated",
                 "Treat a frame that equals the last changed one as a repetition: its interval "
                 "continues, and the last picture is drawn again. For webcams and editors that "
                 "repeat frames to raise the framerate. Frames that are flagged GAP or have the "
                 "memory of the last one are always repetitions");
  constexpr auto max_time = gint64{GST_SECOND};
  properties.add(simulation<&eventcamera::Settings::rolling_shutter>, "rolling-shutter",
                 "Time from the readout of the first row of a frame to the last (ns; negative if "
                 "the bottom row is read first; 0 = all rows at once). The PTS of a frame is the "
                 "time of the row read first. Events drawn as video have the rows of the frames",
                 -max_time, max_time);
  // Overrides GstBaseTransform's, which is off by default.
  install_property(
      klass, {set_qos, get_qos},
      g_param_spec_boolean("qos", "QoS",
                           "Skip whole frames, without processing them, if downstream is late; the "
                           "next interval is longer. By default on for events drawn as video, off "
                           "for events",
                           TRUE, mutable_playing_flags));
  install_stats(klass, stats_of,
                "Counters since start: frames (processed), skipped-frames (due to qos), "
                "repeated-frames (by upstream), processing-time (of all processed frames, ns)");
}

/// Makes the method's settings here, because the method is not yet known in init.
static void constructed(GObject* object) {
  const auto& method = method_of(object);
  *simulation_of(object).settings.lock() = defaults_of(method);
  if (method.make_settings != nullptr) priv_of(object).method_settings = method.make_settings();
  G_OBJECT_CLASS(parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(object));
  G_OBJECT_CLASS(parent_class)->finalize(object);
}

static void gst_event_simulator_init(GstEventSimulator* self) {
  std::construct_at(&priv_of(self), self);
  gst_base_transform_set_qos_enabled(GST_BASE_TRANSFORM(self), TRUE);
}

static void gst_event_simulator_class_init(GstEventSimulatorClass* klass) {
  parent_class = g_type_class_peek_parent(klass);
  g_type_class_adjust_private_offset(klass, &private_offset);
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  install_base_properties(object_class);

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = transform_caps;
  transform_class->fixate_caps = fixate_caps;
  transform_class->set_caps = set_caps;
  transform_class->propose_allocation = propose_allocation;
  transform_class->decide_allocation = decide_allocation;
  transform_class->transform_size = transform_size;
  // Intervals inherit no metadata from the frame that ends them.
  transform_class->copy_metadata = [](GstBaseTransform*, GstBuffer*, GstBuffer*) -> gboolean {
    return TRUE;
  };
  // Never called, because generate_output() is overridden. GstBaseTransform allocates output
  // buffers only for classes that have a transform().
  transform_class->transform = [](GstBaseTransform*, GstBuffer*, GstBuffer*) {
    return GST_FLOW_NOT_SUPPORTED;
  };
  transform_class->submit_input_buffer = submit_input_buffer;
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
  GST_EVENT_SIMULATOR_CLASS(klass)->method = &method;
  method.video.install_pads(GST_ELEMENT_CLASS(klass));
  install_method_properties(G_OBJECT_CLASS(klass), method);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), method.long_name,
                                        "Filter/Effect/Converter/Video", method.description,
                                        EVENTSIM_AUTHORS);
}

GType event_simulator_type(const EventSimulatorMethod& method, GType parent) {
  return row_type(parent, method.type_name, method_class_init, &method);
}
