// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/glsimulator/gl_display.hpp"

#include <gst/gl/egl/gstgldisplay_egl.h>
#include <gst/gl/egl/gstgldisplay_egl_device.h>

GstGLContext* gl_context_of(GstGLDisplay* display, GstGLContext* other, GError** error) {
  GstGLContext* context = nullptr;
  GST_OBJECT_LOCK(display);
  do {
    gst_clear_object(&context);
    context = gst_gl_display_get_gl_context_for_thread(display, nullptr);
  } while ((context != nullptr || gst_gl_display_create_context(display, other, &context, error)) &&
           !gst_gl_display_add_context(display, context));
  GST_OBJECT_UNLOCK(display);
  return context;
}

static GstGLDisplay* that_works(GstGLDisplay* display) {
  if (display == nullptr) return nullptr;
  GstGLContext* context = gl_context_of(display, nullptr, nullptr);
  if (context == nullptr) gst_clear_object(&display);
  gst_clear_object(&context);
  return display;
}

static GstGLDisplay* display_of_screen() {
  GstGLDisplay* display = gst_gl_display_new();
  // Without a screen, GStreamer makes a display of no type, and crashes when it opens a window.
  if (G_OBJECT_TYPE(display) == GST_TYPE_GL_DISPLAY) gst_clear_object(&display);
  return that_works(display);
}

/// Finds a display of a device without a screen, which GstGL does not do itself.
static GstGLDisplay* find_device() {
  for (guint device = 0;; ++device) {
    auto* found = gst_gl_display_egl_device_new(device);
    if (found == nullptr) return nullptr;
    if (auto* display = that_works(GST_GL_DISPLAY(found))) return display;
  }
}

/// The display that all elements without a screen share: EGL has one display per device and
/// process, which GstGL terminates with the first of its objects, even if others are still in use.
static GstGLDisplay* display_of_device() {
  static GstGLDisplay* const display = [] {
    GstGLDisplay* const found = find_device();
    if (found == nullptr) return found;
    GstGLDisplayEGL* const egl = gst_gl_display_egl_from_gl_display(found);
    GST_OBJECT_FLAG_SET(found, GST_OBJECT_FLAG_MAY_BE_LEAKED);
    GST_OBJECT_FLAG_SET(egl, GST_OBJECT_FLAG_MAY_BE_LEAKED);  // held by `found`
    gst_object_unref(egl);
    return found;
  }();
  return display == nullptr ? nullptr : GST_GL_DISPLAY(gst_object_ref(display));
}

GstGLDisplay* gl_display() {
  // Variables with which users select a screen.
  const bool has_screen = g_getenv("DISPLAY") != nullptr ||
                          g_getenv("WAYLAND_DISPLAY") != nullptr ||
                          g_getenv("GST_GL_WINDOW") != nullptr;
  GstGLDisplay* display = has_screen ? display_of_screen() : nullptr;
  if (display == nullptr) display = display_of_device();
  return display == nullptr && !has_screen ? display_of_screen() : display;
}
