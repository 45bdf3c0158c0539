// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>

#include <memory>

#include "gst/simulator/eventsimulator.hpp"
#include "src/gl/simulator.hpp"

/// Base class of the simulators of frames in OpenGL textures. It shares the display and the context
/// with neighbouring elements, or finds them itself, with or without a screen.
#define GST_TYPE_GL_EVENT_SIMULATOR (gst_gl_event_simulator_get_type())
G_DECLARE_DERIVABLE_TYPE(GstGLEventSimulator, gst_gl_event_simulator, GST, GL_EVENT_SIMULATOR,
                         GstEventSimulator)

struct _GstGLEventSimulatorClass {
  GstEventSimulatorClass parent_class;
};

inline constexpr SimulatorVideo gl_memory_video = {
    .memory = GST_CAPS_FEATURE_MEMORY_GL_MEMORY,
    .formats =
        "{ GRAY8, I420, YV12, NV12, NV21, Y42B, Y444, Y41B, YUY2, UYVY, AYUV, VUYA, RGBA, "
        "BGRA, RGBx, BGRx, ARGB, ABGR, xRGB, xBGR, RGB, BGR }",
    .drawn_formats = "{ RGBA }",
    .texture_target = GST_GL_TEXTURE_TARGET_2D_STR,
};

using MakeGlSimulator = std::unique_ptr<eventcamera::gl::Simulator> (*)(
    const eventcamera::gl::Context& gl, const eventcamera::LumaFormat& format);

/// Creates the simulator that `make` returns, in the context of a GstGLEventSimulator.
std::unique_ptr<VideoSimulator> in_gl_memory(GObject* element, const GstVideoInfo& video,
                                             MakeGlSimulator make);

/// For EventSimulatorMethod::create.
template <auto make>
std::unique_ptr<VideoSimulator> in_gl_memory(GObject* element, const GstVideoInfo& video) {
  return in_gl_memory(
      element, video,
      [](const eventcamera::gl::Context& gl, const eventcamera::LumaFormat& format)
          -> std::unique_ptr<eventcamera::gl::Simulator> { return make(gl, format); });
}
