// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-gleventsim-dense
 * @title: gleventsim-dense
 * @short_description: events from frames interpolated with dense optical flow, on the GPU
 *
 * #GstEventSimDense for video in OpenGL textures, with compute shaders. The same flow gives the
 * same events. The flow differs in the last bits of floating-point numbers, and more if the CPU
 * computes it only around changed pixels, with another pyramid and other borders. Needs OpenGL ES
 * 3.1 or OpenGL 4.3. Works without a screen; beside other elements of OpenGL, only if the
 * environment variable GST_GL_WINDOW is egl-device.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! glupload ! gleventsim-dense !
 * eventstats ! fakesink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/glsimulator/gleventsimulator.hpp"
#include "gst/simulator/dense_properties.hpp"
#include "src/gl/simulator.hpp"

using eventcamera::FlowMethod;
using eventcamera::gl::DenseSimulator;

using Settings = DenseSettings<FlowMethod::farneback>;

static void install_properties(GObjectClass* klass) {
  Settings::install(klass, enum_type<FlowMethod>("GstGLEventSimFlowMethod", {farneback_flow}));
}

static void configure(eventcamera::IntervalSimulator& simulator, GObject* object) {
  static_cast<DenseSimulator&>(simulator).set_interpolation(
      Settings::of(object).copy().interpolation);
}

static const EventSimulatorMethod dense = {
    .type_name = "GstGLEventSimDense",
    .long_name = "Event camera simulator: dense interpolation, on the GPU",
    .description = "Turns video into events: interpolates frames with dense optical flow",
    .threshold = 2,
    .interpolates = true,
    .create = in_gl_memory<eventcamera::gl::make_dense_simulator>,
    .video = gl_memory_video,
    .make_settings = Settings::make,
    .install_properties = install_properties,
    .configure = configure,
};
GST_ELEMENT_REGISTER_DEFINE(gleventsim_dense, "gleventsim-dense", GST_RANK_NONE,
                            event_simulator_type(dense, GST_TYPE_GL_EVENT_SIMULATOR))
