// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/gl/gl.h>

#include <mutex>
#include <string>

/// Advice if OpenGL is unavailable: use the element on the CPU, which has the same name without
/// "gl".
std::string advice_of(GstElement* element);

/// The OpenGL display and context of an element, which it shares with its neighbours and with the
/// application. All functions may be called from any thread.
class SharedContext {
 public:
  SharedContext(GstBaseTransform* element, GstDebugCategory* category)
      : element_(GST_ELEMENT(element)), category_(category) {}
  ~SharedContext() { close(); }
  SharedContext(const SharedContext&) = delete;
  SharedContext& operator=(const SharedContext&) = delete;

  /// Finds a display. False, after an error message, if there is none.
  bool open();
  void close();

  /// Adopts a display or a context that a neighbour or the application shares.
  void set_context(GstContext* context);
  /// Answers a context query. False if it asks for something else.
  bool answer(GstQuery* query);

  /// Returns the context shared with the neighbours, or else the context of the display; null with
  /// an error if there is none.
  GstGLContext* find(GError** error);
  /// Makes find() replace this context, which is lost.
  void forget(GstGLContext* context);

  GstDebugCategory* category() const { return category_; }

 private:
  template <class Object>
  bool ask_for(const char* type, Object* SharedContext::*object);
  bool provide_display();

  GstElement* element_;
  GstDebugCategory* category_;
  std::recursive_mutex mutex_;
  GstGLDisplay* display_ = nullptr;
  GstGLContext* other_ = nullptr;  ///< of the application, to share objects with
  GstGLContext* context_ = nullptr;
};

/// The context of a GstGLEventSimulator.
SharedContext& context_of(gpointer element);
