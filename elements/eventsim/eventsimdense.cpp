// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-dense
 * @title: eventsim-dense
 * @short_description: events from frames interpolated with dense optical flow
 *
 * Turns video into what an event camera would have seen. Dense optical flow between two frames
 * makes interpolated frames; what changed from one of these to the next by more than the thresholds
 * fires, at the later one's time (Ziegler et al., Real-time event simulation with frame-based
 * cameras, ICRA 2023, section III-A).
 *
 * For scenes in which everything moves, such as those of a moving camera.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=drive.mp4 ! decodebin ! eventsim-dense flow=dis-hq ! videoconvert
 * ! x264enc ! mp4mux ! filesink location=events.mp4
 * ]|
 */
#include <atomic>

#include "gst/base/eventsimulator.hpp"
#include "src/simulate/dense.hpp"

using eventcamera::DenseSimulator;
using eventcamera::FlowMethod;
using eventcamera::Interpolation;

namespace {

constexpr double default_threshold = 2;
constexpr FlowMethod default_flow = FlowMethod::dis_lq;
constexpr Interpolation default_interpolation = Interpolation::forward;

enum Property {
  prop_flow = GST_EVENT_SIMULATOR_FIRST_OWN_PROPERTY,
  prop_interpolation,
};

struct GstEventSimDense {
  GstEventSimulator parent;
  std::atomic<FlowMethod> flow;
  std::atomic<Interpolation> interpolation;
};

struct GstEventSimDenseClass {
  GstEventSimulatorClass parent_class;
};

}  // namespace

static GType flow_method_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(FlowMethod::dis_lq),
         "DIS, low quality: fast, and blind to small things that move far", "dis-lq"},
        {static_cast<int>(FlowMethod::dis_hq), "DIS, high quality", "dis-hq"},
        {static_cast<int>(FlowMethod::farneback), "Farneback", "farneback"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimFlowMethod", values);
  }();
  return type;
}

static GType interpolation_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(Interpolation::forward), "The earlier frame, moved along the flow",
         "forward"},
        {static_cast<int>(Interpolation::blend),
         "The earlier frame moved on and the later frame moved back, blended", "blend"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimInterpolation", values);
  }();
  return type;
}

G_DEFINE_TYPE(GstEventSimDense, gst_event_sim_dense, GST_TYPE_EVENT_SIMULATOR)
GST_ELEMENT_REGISTER_DEFINE(eventsim_dense, "eventsim-dense", GST_RANK_NONE,
                            gst_event_sim_dense_get_type())

static GstEventSimDense* dense(void* object) {
  return G_TYPE_CHECK_INSTANCE_CAST(object, gst_event_sim_dense_get_type(), GstEventSimDense);
}

static std::unique_ptr<eventcamera::Simulator> create(GstEventSimulator*,
                                                      const eventcamera::LumaFormat& format) {
  return eventcamera::make_dense_simulator(format);
}

static void configure(GstEventSimulator* element, eventcamera::Simulator& simulator) {
  const auto* self = dense(element);
  auto& dense_simulator = static_cast<DenseSimulator&>(simulator);
  dense_simulator.set_flow(self->flow);
  dense_simulator.set_interpolation(self->interpolation);
}

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto* self = dense(object);
  switch (id) {
    case prop_flow:
      self->flow = static_cast<FlowMethod>(g_value_get_enum(value));
      break;
    case prop_interpolation:
      self->interpolation = static_cast<Interpolation>(g_value_get_enum(value));
      break;
    default:
      gst_event_simulator_set_property(object, id, value, spec);
      break;
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto* self = dense(object);
  switch (id) {
    case prop_flow:
      g_value_set_enum(value, static_cast<int>(self->flow.load()));
      break;
    case prop_interpolation:
      g_value_set_enum(value, static_cast<int>(self->interpolation.load()));
      break;
    default:
      gst_event_simulator_get_property(object, id, value, spec);
      break;
  }
}

static void gst_event_sim_dense_init(GstEventSimDense* self) {
  self->flow = default_flow;
  self->interpolation = default_interpolation;
}

static void gst_event_sim_dense_class_init(GstEventSimDenseClass* klass) {
  constexpr auto flags = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                  GST_PARAM_MUTABLE_PLAYING);
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  g_object_class_install_property(
      object_class, prop_flow,
      g_param_spec_enum("flow", "Flow", "How the motion between two frames is found",
                        flow_method_get_type(), static_cast<int>(default_flow), flags));
  g_object_class_install_property(
      object_class, prop_interpolation,
      g_param_spec_enum("interpolation", "Interpolation",
                        "How the frames between two frames are made", interpolation_get_type(),
                        static_cast<int>(default_interpolation), flags));

  GstEventSimulatorClass* simulator_class = GST_EVENT_SIMULATOR_CLASS(klass);
  simulator_class->create = create;
  simulator_class->configure = configure;
  gst_event_simulator_class_install_thresholds(simulator_class, default_threshold);
  gst_event_simulator_class_install_interpolated_frames(simulator_class);
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Event camera simulator: dense interpolation", "Converter/Video",
      "Turns video into events: interpolates frames with dense optical flow", "gst-eventsim");
  gst_type_mark_as_plugin_api(flow_method_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(interpolation_get_type(), static_cast<GstPluginAPIFlags>(0));
}
