// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/context.hpp"

#include <cstdio>
#include <string>
#include <string_view>

namespace eventcamera::gl {

Context::Context(const Load& load) {
  const auto get_string = reinterpret_cast<PFNGLGETSTRINGPROC>(load("glGetString"));
  const auto* text =
      get_string != nullptr ? reinterpret_cast<const char*>(get_string(GL_VERSION)) : nullptr;
  if (text == nullptr) throw ContextLost("no OpenGL context is current, or it is lost");
  std::string_view version = text;
  constexpr std::string_view es = "OpenGL ES ";
  is_es_ = version.starts_with(es);
  if (is_es_) version.remove_prefix(es.size());
  int major = 0;
  int minor = 0;
  std::sscanf(version.data(), "%d.%d", &major, &minor);
  const int needed = is_es_ ? 301 : 403;
  const auto too_old = [&](const std::string& reason) {
    return Error("compute shaders need OpenGL ES 3.1 or OpenGL 4.3, and " + reason);
  };
  if (100 * major + minor < needed)
    throw too_old(std::string("this is ") + (is_es_ ? "" : "OpenGL ") + text);
#define LOAD(type, name)                             \
  (name) = reinterpret_cast<type>(load("gl" #name)); \
  if ((name) == nullptr) throw too_old("gl" #name " is missing");
  EVENTCAMERA_GL_FUNCTIONS(LOAD)
#undef LOAD
  const auto get_display =
      reinterpret_cast<PFNEGLGETCURRENTDISPLAYPROC>(load("eglGetCurrentDisplay"));
  CreateSync = reinterpret_cast<PFNEGLCREATESYNCKHRPROC>(load("eglCreateSyncKHR"));
  WaitForSync = reinterpret_cast<PFNEGLCLIENTWAITSYNCKHRPROC>(load("eglClientWaitSyncKHR"));
  DestroySync = reinterpret_cast<PFNEGLDESTROYSYNCKHRPROC>(load("eglDestroySyncKHR"));
  GetCurrentContext = reinterpret_cast<PFNEGLGETCURRENTCONTEXTPROC>(load("eglGetCurrentContext"));
  ReleaseThread = reinterpret_cast<PFNEGLRELEASETHREADPROC>(load("eglReleaseThread"));
  if (get_display != nullptr && CreateSync != nullptr && WaitForSync != nullptr &&
      DestroySync != nullptr && GetCurrentContext != nullptr && ReleaseThread != nullptr)
    egl_display = get_display();
  for (const char* name : {"glGetGraphicsResetStatus", "glGetGraphicsResetStatusKHR",
                           "glGetGraphicsResetStatusEXT", "glGetGraphicsResetStatusARB"})
    if (get_reset_status_ == nullptr)
      get_reset_status_ = reinterpret_cast<decltype(get_reset_status_)>(load(name));
  GetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &max_buffer_size_);
}

void Context::abandon() {
  DeleteBuffers = [](GLsizei, const GLuint*) {};
  DeleteProgram = [](GLuint) {};
  DeleteSync = [](GLsync) {};
  DestroySync = [](EGLDisplay, EGLSyncKHR) -> EGLBoolean { return EGL_TRUE; };
}

GLenum Context::next_error() const {
  constexpr GLenum context_lost = 0x0507;
  const bool is_reset = get_reset_status_ != nullptr && get_reset_status_() != GL_NO_ERROR;
  const GLenum code = is_reset ? context_lost : GetError();
  if (code == context_lost)
    throw ContextLost("the OpenGL context was lost, because the GPU was reset or removed");
  return code;
}

void Context::forget_errors() const {
  constexpr int max_errors = 8;  // without a context, glGetError() reports errors forever
  for (int i = 0; i < max_errors && next_error() != GL_NO_ERROR; ++i) {
  }
}

void Context::check() const {
  const GLenum code = next_error();
  if (code == GL_NO_ERROR) return;
  if (code == GL_OUT_OF_MEMORY) throw Error("OpenGL is out of memory");
  char message[32];
  std::snprintf(message, sizeof message, "OpenGL error 0x%04x", code);
  throw Error(message);
}

}  // namespace eventcamera::gl
