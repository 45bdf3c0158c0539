// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>

/// Returns a new reference to a display that OpenGL contexts can be created in, with one in it:
/// that of the screen, or, without one, that of a GPU or a software renderer. nullptr if there is
/// none.
GstGLDisplay* gl_display();

/// Returns a new reference to the context of a display, made if it has none; nullptr if that fails.
/// `other`, if any, is a context to share objects with.
GstGLContext* gl_context_of(GstGLDisplay* display, GstGLContext* other, GError** error);
