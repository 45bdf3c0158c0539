// SPDX-License-Identifier: LGPL-2.1-or-later
/// Simulators without properties of their own: a table of methods.
#include "gst/base/gleventsimulator.hpp"
#include "src/gl/frame.hpp"

/**
 * SECTION:element-gleventsim-frame
 * @title: gleventsim-frame
 * @short_description: events from the difference frame, on the GPU
 *
 * #GstEventSimFrame for video in OpenGL textures, with compute shaders: the same events for the
 * same frames. Needs OpenGL ES 3.1 or OpenGL 4.3; works without a screen. Worth it where the video
 * is in the memory of the GPU already.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=100 ! glupload ! gleventsim-frame ! eventstats ! fakesink
 * ]|
 */
static const EventSimulatorMethod frame = {
    .type_name = "GstGLEventSimFrame",
    .long_name = "Event camera simulator: difference frame, on the GPU",
    .description = "Turns video into events: thresholds the difference of successive frames",
    .threshold = 20,
    .create = in_gl_memory<eventcamera::gl::make_frame_simulator>,
    .video = gl_memory_video,
};
GST_ELEMENT_REGISTER_DEFINE(gleventsim_frame, "gleventsim-frame", GST_RANK_NONE,
                            event_simulator_type(frame, GST_TYPE_GL_EVENT_SIMULATOR))
