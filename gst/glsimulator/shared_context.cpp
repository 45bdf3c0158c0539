// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/glsimulator/shared_context.hpp"

#include <gst/gl/egl/gstgldisplay_egl.h>
#include <gst/gl/egl/gstgldisplay_egl_device.h>

#include "gst/base/errors.hpp"

/// Returns a new reference to the context of a display, creating it if needed; nullptr on failure.
/// `other`, if any, is a context to share objects with.
static GstGLContext* gl_context_of(GstGLDisplay* display, GstGLContext* other, GError** error) {
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

/// Passes a display on if it can create a context; otherwise frees it and returns nullptr.
static GstGLDisplay* if_working(GstGLDisplay* display) {
  if (display == nullptr) return nullptr;
  GstGLContext* context = gl_context_of(display, nullptr, nullptr);
  if (context == nullptr) gst_clear_object(&display);
  gst_clear_object(&context);
  return display;
}

static GstGLDisplay* display_of_screen() {
  GstGLDisplay* display = gst_gl_display_new();
  // Without a screen, gst_gl_display_new() makes a dummy display, whose context crashes when it
  // opens a window.
  if (G_OBJECT_TYPE(display) == GST_TYPE_GL_DISPLAY) gst_clear_object(&display);
  return if_working(display);
}

/// Finds a display of a device without a screen, which GstGL does not do itself.
static GstGLDisplay* find_device() {
  for (guint device = 0;; ++device) {
    auto* found = gst_gl_display_egl_device_new(device);
    if (found == nullptr) return nullptr;
    if (auto* display = if_working(GST_GL_DISPLAY(found))) return display;
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

/// Returns a new reference to a display with an OpenGL context: the screen or, without a screen, a
/// GPU or a software renderer. nullptr if there is none.
static GstGLDisplay* gl_display() {
  // Variables with which users select a screen.
  const bool has_screen = g_getenv("DISPLAY") != nullptr ||
                          g_getenv("WAYLAND_DISPLAY") != nullptr ||
                          g_getenv("GST_GL_WINDOW") != nullptr;
  GstGLDisplay* display = has_screen ? display_of_screen() : nullptr;
  if (display == nullptr) display = display_of_device();
  return display == nullptr && !has_screen ? display_of_screen() : display;
}

std::string advice_of(GstElement* element) {
  const auto* factory = gst_element_get_factory(element);
  if (factory == nullptr) return " Use the element that runs on the CPU.";
  return std::string(" Use ") + (GST_OBJECT_NAME(factory) + 2) + ", which runs on the CPU.";
}

/// Asks the neighbours and the application for an object, which set_context() then stores. Returns
/// true if there is one. Must be called without the lock: neighbours may query this element.
template <class Object>
bool SharedContext::ask_for(const char* type, Object* SharedContext::*object) {
  const auto is_known = [this, object] {
    const std::lock_guard lock(mutex_);
    return this->*object != nullptr;
  };
  GstQuery* query = gst_query_new_context(type);
  for (GstPad* pad :
       {GST_BASE_TRANSFORM_SRC_PAD(element_), GST_BASE_TRANSFORM_SINK_PAD(element_)}) {
    GstContext* context = nullptr;
    if (!is_known() && gst_pad_peer_query(pad, query)) {
      gst_query_parse_context(query, &context);
      if (context != nullptr) gst_element_set_context(element_, context);
    }
  }
  gst_query_unref(query);
  if (!is_known())
    gst_element_post_message(element_, gst_message_new_need_context(GST_OBJECT(element_), type));
  return is_known();
}

/// Makes a display, and shares it with the pipeline. False if there is none.
bool SharedContext::provide_display() {
  GstGLDisplay* display = gl_display();
  if (display == nullptr) return false;
  GstContext* context = gst_context_new(GST_GL_DISPLAY_CONTEXT_TYPE, TRUE);
  gst_context_set_gl_display(context, display);
  gst_object_unref(display);
  gst_element_set_context(element_, context);
  gst_element_post_message(element_, gst_message_new_have_context(GST_OBJECT(element_), context));
  return true;
}

bool SharedContext::open() {
  if (ask_for(GST_GL_DISPLAY_CONTEXT_TYPE, &SharedContext::display_) || provide_display()) {
    ask_for("gst.gl.app_context", &SharedContext::other_);
    return true;
  }
  post_message(element_, GST_MESSAGE_ERROR,
               {GST_RESOURCE_ERROR_NOT_FOUND,
                "OpenGL does not work here: there is no screen, no GPU and no software renderer "
                "(Debian: libgl1-mesa-dri)." +
                    advice_of(element_)},
               "no GstGLDisplay has a context");
  return false;
}

void SharedContext::close() {
  const std::lock_guard lock(mutex_);
  gst_clear_object(&context_);
  gst_clear_object(&other_);
  gst_clear_object(&display_);
}

void SharedContext::set_context(GstContext* context) {
  const std::lock_guard lock(mutex_);
  const auto* const last = display_;
  gst_gl_handle_set_context(element_, context, &display_, &other_);
  if (display_ != last) gst_clear_object(&context_);  // it belongs to the last one
}

bool SharedContext::answer(GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_CONTEXT) return false;
  const std::lock_guard lock(mutex_);
  return gst_gl_handle_context_query(element_, query, display_, context_, other_) != FALSE;
}

GstGLContext* SharedContext::find(GError** error) {
  {
    const std::lock_guard lock(mutex_);
    if (context_ != nullptr) return context_;
  }
  GstGLContext* shared = nullptr;  // asked for without the lock: neighbours may query this element
  gst_gl_query_local_gl_context(element_, GST_PAD_SRC, &shared);
  if (shared == nullptr) gst_gl_query_local_gl_context(element_, GST_PAD_SINK, &shared);

  const std::lock_guard lock(mutex_);
  if (context_ == nullptr) std::swap(context_, shared);
  if (context_ == nullptr) context_ = gl_context_of(display_, other_, error);
  gst_clear_object(&shared);
  return context_;
}

void SharedContext::forget(GstGLContext* context) {
  const std::lock_guard lock(mutex_);
  if (context_ != context) return;
  GST_CAT_WARNING_OBJECT(category_, element_, "lost %" GST_PTR_FORMAT ", looking for another",
                         context);
  GST_OBJECT_LOCK(display_);
  gst_gl_display_remove_context(display_, context);
  GST_OBJECT_UNLOCK(display_);
  gst_clear_object(&context_);
  gst_pad_mark_reconfigure(GST_BASE_TRANSFORM_SRC_PAD(element_));  // its textures are lost, too
}
