// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl31.h>

#include <functional>
#include <stdexcept>
#include <string_view>

namespace eventcamera::gl {

/// OpenGL is missing, too old or lost, or a call failed. The message is for users.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The context is lost, with all its objects.
class ContextLost : public Error {
 public:
  using Error::Error;
};

#define EVENTCAMERA_GL_FUNCTIONS(X)                \
  X(PFNGLACTIVETEXTUREPROC, ActiveTexture)         \
  X(PFNGLATTACHSHADERPROC, AttachShader)           \
  X(PFNGLBINDBUFFERPROC, BindBuffer)               \
  X(PFNGLBINDBUFFERBASEPROC, BindBufferBase)       \
  X(PFNGLBINDTEXTUREPROC, BindTexture)             \
  X(PFNGLBUFFERDATAPROC, BufferData)               \
  X(PFNGLBUFFERSUBDATAPROC, BufferSubData)         \
  X(PFNGLCLIENTWAITSYNCPROC, ClientWaitSync)       \
  X(PFNGLCOMPILESHADERPROC, CompileShader)         \
  X(PFNGLCREATEPROGRAMPROC, CreateProgram)         \
  X(PFNGLCREATESHADERPROC, CreateShader)           \
  X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)         \
  X(PFNGLDELETEPROGRAMPROC, DeleteProgram)         \
  X(PFNGLDELETESHADERPROC, DeleteShader)           \
  X(PFNGLDELETESYNCPROC, DeleteSync)               \
  X(PFNGLDISPATCHCOMPUTEPROC, DispatchCompute)     \
  X(PFNGLFENCESYNCPROC, FenceSync)                 \
  X(PFNGLFLUSHPROC, Flush)                         \
  X(PFNGLGENBUFFERSPROC, GenBuffers)               \
  X(PFNGLGETERRORPROC, GetError)                   \
  X(PFNGLGETINTEGER64VPROC, GetInteger64v)         \
  X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog) \
  X(PFNGLGETPROGRAMIVPROC, GetProgramiv)           \
  X(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)   \
  X(PFNGLGETSHADERIVPROC, GetShaderiv)             \
  X(PFNGLLINKPROGRAMPROC, LinkProgram)             \
  X(PFNGLMAPBUFFERRANGEPROC, MapBufferRange)       \
  X(PFNGLMEMORYBARRIERPROC, MemoryBarrier)         \
  X(PFNGLSHADERSOURCEPROC, ShaderSource)           \
  X(PFNGLTEXSUBIMAGE2DPROC, TexSubImage2D)         \
  X(PFNGLUNIFORM1IPROC, Uniform1i)                 \
  X(PFNGLUNMAPBUFFERPROC, UnmapBuffer)             \
  X(PFNGLUSEPROGRAMPROC, UseProgram)

/// Functions and limits of the current OpenGL context. This object and all objects made with it may
/// only be used, and destroyed, while that context, or one that shares its objects, is current.
class Context {
 public:
  /// Returns the address of an OpenGL function; nullptr if there is none.
  using Load = std::function<void*(const char* name)>;

  /// Throws Error if the context has no compute shaders: they need OpenGL ES 3.1 or OpenGL 4.3.
  explicit Context(const Load& load);
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

#define DECLARE(type, name) type name;
  EVENTCAMERA_GL_FUNCTIONS(DECLARE)
#undef DECLARE

  /// EGL fences: any thread can wait for them without a context. Null, like the display, if the
  /// context is not one of EGL.
  PFNEGLCREATESYNCKHRPROC CreateSync = nullptr;
  PFNEGLCLIENTWAITSYNCKHRPROC WaitForSync = nullptr;
  PFNEGLDESTROYSYNCKHRPROC DestroySync = nullptr;
  PFNEGLGETCURRENTCONTEXTPROC GetCurrentContext = nullptr;
  PFNEGLRELEASETHREADPROC ReleaseThread = nullptr;
  EGLDisplay egl_display = nullptr;

  /// Called with the name of each kernel before it runs, for measurements; may be empty.
  std::function<void(std::string_view kernel)> on_kernel;

  /// First lines of every shader.
  const char* shader_version() const {
    return is_es_ ? "#version 310 es\nprecision highp float;\nprecision highp int;\n"
                  : "#version 430\n";
  }

  /// Maximum size of a buffer that a shader can access, in bytes.
  GLint64 max_buffer_size() const {
    return max_buffer_size_;
  }

  /// Stops deleting GL objects, which were deleted with a lost context. Nothing else may be called
  /// afterwards.
  void abandon();

  /// Clears the errors of OpenGL calls. Throws ContextLost if the context is lost.
  void forget_errors() const;

  /// Throws Error if the context is lost, or an OpenGL call failed since the last check.
  void check() const;

 private:
  /// Throws ContextLost.
  GLenum next_error() const;

  GLenum(GL_APIENTRY* get_reset_status_)() = nullptr;  ///< null if the context is not robust
  bool is_es_ = false;
  GLint64 max_buffer_size_ = 0;
};

}  // namespace eventcamera::gl
