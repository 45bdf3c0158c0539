// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>

/// Returns a new reference to a display with an OpenGL context: the screen or, without a screen, a
/// GPU or a software renderer. nullptr if there is none.
GstGLDisplay* gl_display();

/// Returns a new reference to the context of a display, creating it if needed; nullptr on failure.
/// `other`, if any, is a context to share objects with.
GstGLContext* gl_context_of(GstGLDisplay* display, GstGLContext* other, GError** error);
