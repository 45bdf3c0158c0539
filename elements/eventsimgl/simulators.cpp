// SPDX-License-Identifier: LGPL-2.1-or-later
/// Simulators without properties of their own: a table of methods.
#include "gst/glsimulator/gleventsimulator.hpp"
#include "src/gl/simulator.hpp"

/**
 * SECTION:element-gleventsim-frame
 * @title: gleventsim-frame
 * @short_description: events from the difference of two frames, on the GPU
 *
 * #GstEventSimFrame for video in OpenGL textures, with compute shaders; the same frames give the
 * same events. Needs OpenGL ES 3.1 or OpenGL 4.3. Works without a screen; beside other elements of
 * OpenGL, only if the environment variable GST_GL_WINDOW is egl-device. Use it for video that is
 * already in GPU memory; video in system memory is uploaded first.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=100 ! gleventsim-frame ! eventstats ! fakesink
 * ]|
 *
 * Since: 0.1
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

/**
 * SECTION:element-gleventsim-sparse
 * @title: gleventsim-sparse
 * @short_description: events by sparse interpolation, on the GPU
 *
 * #GstEventSimSparse for video in OpenGL textures, with compute shaders. The same tracks give the
 * same events; tracks differ at most in the last bits of floating-point numbers. Needs OpenGL ES
 * 3.1 or OpenGL 4.3. Works without a screen; beside other elements of OpenGL, only if the
 * environment variable GST_GL_WINDOW is egl-device.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! glupload ! gleventsim-sparse !
 * glimagesink
 * ]|
 *
 * Since: 0.1
 */
static const EventSimulatorMethod sparse = {
    .type_name = "GstGLEventSimSparse",
    .long_name = "Event camera simulator: sparse interpolation, on the GPU",
    .description = "Turns video into events: interpolates frames where pixels changed",
    .threshold = 10,
    .interpolates = true,
    .create = in_gl_memory<eventcamera::gl::make_sparse_simulator>,
    .video = gl_memory_video,
};
GST_ELEMENT_REGISTER_DEFINE(gleventsim_sparse, "gleventsim-sparse", GST_RANK_NONE,
                            event_simulator_type(sparse, GST_TYPE_GL_EVENT_SIMULATOR))

/**
 * SECTION:element-gleventsim-diff
 * @title: gleventsim-diff
 * @short_description: events by difference interpolation, on the GPU
 *
 * #GstEventSimDiff for video in OpenGL textures, with compute shaders. The same tracks give the
 * same events; tracks differ at most in the last bits of floating-point numbers. Needs OpenGL ES
 * 3.1 or OpenGL 4.3. Works without a screen; beside other elements of OpenGL, only if the
 * environment variable GST_GL_WINDOW is egl-device.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! glupload ! gleventsim-diff !
 * eventstats ! fakesink
 * ]|
 *
 * Since: 0.1
 */
static const EventSimulatorMethod diff = {
    .type_name = "GstGLEventSimDiff",
    .long_name = "Event camera simulator: difference interpolation, on the GPU",
    .description =
        "Turns video into events: tracks what changed from one difference frame to the next",
    .threshold = 20,
    .interpolates = true,
    .create = in_gl_memory<eventcamera::gl::make_diff_simulator>,
    .video = gl_memory_video,
};
GST_ELEMENT_REGISTER_DEFINE(gleventsim_diff, "gleventsim-diff", GST_RANK_NONE,
                            event_simulator_type(diff, GST_TYPE_GL_EVENT_SIMULATOR))
