// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-gleventsim-dvs
 * @title: gleventsim-dvs
 * @short_description: events from a physical pixel model, on the GPU
 *
 * #GstEventSimDvs for video in OpenGL textures, with a compute shader for the pixels; the same
 * presets, properties and profiles, except label. It calculates in single precision: in at most 1
 * of 10,000 pixels events differ, and 1 time of 1,000 differs by more than a microsecond.
 *
 * Frames stay on the GPU with the presets ideal, esim, v2e-clean, v2e-noisy and icns. For denoise,
 * exposure-compensation and upsampling=motion, they are read back, and the CPU prepares them as in
 * `eventsim-dvs`; it need not estimate the flow if frames have a #GstEventCameraFlowMeta. glupload
 * drops this meta, so leave such frames in system memory: this element uploads them. Events are
 * sorted on the GPU and read back. With pixel-latency, max-rate or rolling-shutter, the CPU delays
 * them and sorts them again.
 *
 * Needs OpenGL ES 3.1 or OpenGL 4.3. Works without a screen; beside other elements of OpenGL, only
 * if the environment variable GST_GL_WINDOW is egl-device.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! glupload ! gleventsim-dvs
 * preset=v2e-noisy ! eventstats ! fakesink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/glsimulator/gleventsimulator.hpp"
#include "gst/simulator/dvs_properties.hpp"
#include "src/gl/simulator.hpp"

static void configure(eventcamera::IntervalSimulator& simulator, GObject* object) {
  static_cast<eventcamera::gl::DvsSimulator&>(simulator).set(dvs_settings_of(object));
}

static const EventSimulatorMethod dvs = {
    .type_name = "GstGLEventSimDvs",
    .long_name = "Event camera simulator: physical pixel, on the GPU",
    .description =
        "Turns video into events: simulates the pixels of an event camera and their "
        "noise",
    .threshold = std::nullopt,
    .has_flow = true,
    .create = in_gl_memory<eventcamera::gl::make_dvs_simulator>,
    .video = gl_memory_video,
    .make_settings = make_dvs_settings,
    .install_properties = install_dvs_properties,
    .configure = configure,
    .fault = fault_of_profile,
};
GST_ELEMENT_REGISTER_DEFINE(gleventsim_dvs, "gleventsim-dvs", GST_RANK_NONE,
                            event_simulator_type(dvs, GST_TYPE_GL_EVENT_SIMULATOR))
