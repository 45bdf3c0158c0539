// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-dense
 * @title: eventsim-dense
 * @short_description: events from frames interpolated with dense optical flow
 *
 * Turns video into the events that an event camera would have reported. Frames are interpolated
 * with dense optical flow; pixels that change between successive interpolated frames by more than
 * the contrast thresholds fire, at the time of the later frame (Ziegler et al., Real-time event
 * simulation with frame-based cameras, ICRA 2023, section III-A).
 *
 * For scenes in which everything moves, as in front of a moving camera.
 *
 * Where a frame has a #GstEventCameraFlowMeta, its optical flow up to the next frame is used
 * instead of estimating it, unless frames were skipped in between.
 * gst_buffer_add_event_camera_flow_meta() adds it, and `flowjoin` joins video and a stream of flow,
 * such as a renderer's. Flow that is not finite counts as 0. With #GstEventSimDense:write-flow,
 * each buffer of events has the flow that was used, from its timestamp to its end; estimated flow
 * is 0 far from changed pixels.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=drive.mp4 ! decodebin ! eventsim-dense flow=dis-hq ! videoconvert
 * ! vp8enc deadline=1 target-bitrate=4000000 ! webmmux ! filesink location=events.webm
 * ]|
 *
 * Since: 0.1
 */
#include "features.hpp"
#include "gst/simulator/dense_properties.hpp"
#include "gst/simulator/luma_video_simulator.hpp"
#include "src/simulate/simulators.hpp"

using eventcamera::DenseSimulator;
using eventcamera::FlowMethod;

using Settings = DenseSettings<FlowMethod::dis_lq>;

static void install_properties(GObjectClass* klass) {
  Settings::install(
      klass,
      enum_type<FlowMethod>(
          "GstEventSimFlowMethod",
          {
              {FlowMethod::dis_lq, "DIS, low quality: fast, misses small objects that move far",
               "dis-lq"},
              {FlowMethod::dis_hq, "DIS, high quality", "dis-hq"},
              farneback_flow,
#ifdef HAVE_OPENCV
              {FlowMethod::opencv_dis,
               "OpenCV's DIS with the parameters of dis-hq, for comparison: slower", "opencv-dis"},
#endif
          }));
}

static void configure(eventcamera::IntervalSimulator& simulator, GObject* object) {
  const Settings settings = Settings::of(object).copy();
  auto& dense = static_cast<DenseSimulator&>(simulator);
  dense.set_flow(settings.flow);
  dense.set_interpolation(settings.interpolation);
}

static const EventSimulatorMethod dense = {
    .type_name = "GstEventSimDense",
    .long_name = "Event camera simulator: dense interpolation",
    .description = "Turns video into events: interpolates frames with dense optical flow",
    .threshold = 2,
    .denoises = true,
    .interpolates = true,
    .has_flow = true,
    .create = in_system_memory<eventcamera::make_dense_simulator>,
    .make_settings = Settings::make,
    .install_properties = install_properties,
    .configure = configure,
};
GST_ELEMENT_REGISTER_DEFINE(eventsim_dense, "eventsim-dense", GST_RANK_NONE,
                            event_simulator_type(dense))
