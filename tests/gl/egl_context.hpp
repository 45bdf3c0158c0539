// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/core/luma.hpp"
#include "src/gl/context.hpp"
#include "src/gl/objects.hpp"

namespace gl_test {

inline void* load(const char* name) {
  return reinterpret_cast<void*>(eglGetProcAddress(name));
}

/// An OpenGL context without a window, current in this thread.
class EglContext {
 public:
  /// OpenGL ES 3.1, or OpenGL 4.3, of the first device that has it.
  explicit EglContext(bool is_es) {
    const auto query_devices =
        reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(load("eglQueryDevicesEXT"));
    EGLDeviceEXT devices[16];
    EGLint count = 0;
    if (query_devices != nullptr) query_devices(16, devices, &count);
    for (EGLint i = 0; i < count; ++i)
      if (open(devices[i], is_es)) return;
    throw std::runtime_error(
        std::string("no OpenGL ") + (is_es ? "ES 3.1" : "4.3") +
        " without a screen: EGL needs the driver of a GPU, or of Mesa (Debian: libgl1-mesa-dri)");
  }
  ~EglContext() {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
  }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

 private:
  bool open(EGLDeviceEXT device, bool is_es) {
    const auto get_display =
        reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(load("eglGetPlatformDisplayEXT"));
    display_ = get_display(EGL_PLATFORM_DEVICE_EXT, device, nullptr);
    if (eglInitialize(display_, nullptr, nullptr) == EGL_FALSE) return false;
    eglBindAPI(is_es ? EGL_OPENGL_ES_API : EGL_OPENGL_API);
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION, is_es ? 3 : 4,
                                 EGL_CONTEXT_MINOR_VERSION, is_es ? 1 : 3, EGL_NONE};
    const EGLint of_config[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                is_es ? EGL_OPENGL_ES3_BIT : EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint configs = 0;
    if (eglChooseConfig(display_, of_config, &config, 1, &configs) == EGL_FALSE) return false;
    context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, attributes);
    return eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_FALSE;
  }

  EGLDisplay display_ = nullptr;
  EGLContext context_ = nullptr;
};

/// A texture of one or four bytes a pixel.
class Texture {
 public:
  Texture(int width, int height, int channels) : format_{width, height, 8}, channels_(channels) {
    gen_textures(1, &name_);
  }
  ~Texture() { delete_textures(1, &name_); }
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;

  void upload(const std::vector<std::uint8_t>& bytes) {
    bind_texture(GL_TEXTURE_2D, name_);
    pixel_store(GL_UNPACK_ALIGNMENT, 1);
    tex_image(GL_TEXTURE_2D, 0, channels_ == 1 ? GL_R8 : GL_RGBA8, format_.width, format_.height, 0,
              channels_ == 1 ? GL_RED : GL_RGBA, GL_UNSIGNED_BYTE, bytes.data());
    tex_parameter(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  }

  GLuint name() const { return name_; }

  /// RGBA bytes.
  std::vector<std::uint8_t> download() const {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(format_.width) *
                                    static_cast<std::size_t>(format_.height) * 4);
    GLuint framebuffer = 0;
    gen_framebuffers(1, &framebuffer);
    bind_framebuffer(GL_FRAMEBUFFER, framebuffer);
    framebuffer_texture(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, name_, 0);
    read_pixels(0, 0, format_.width, format_.height, GL_RGBA, GL_UNSIGNED_BYTE, bytes.data());
    bind_framebuffer(GL_FRAMEBUFFER, 0);
    delete_framebuffers(1, &framebuffer);
    return bytes;
  }

  /// A frame whose luma is the first channel.
  eventcamera::gl::TextureFrame frame() const {
    return {format_, name_, {eventcamera::LumaWeights::one, 0, 0, 0}};
  }
  eventcamera::gl::TextureFrame show(const std::vector<std::uint8_t>& picture) {
    upload(picture);
    return frame();
  }

 private:
#define LOAD(type, name, gl_name) type name = reinterpret_cast<type>(load(gl_name));
  LOAD(PFNGLGENTEXTURESPROC, gen_textures, "glGenTextures")
  LOAD(PFNGLDELETETEXTURESPROC, delete_textures, "glDeleteTextures")
  LOAD(PFNGLBINDTEXTUREPROC, bind_texture, "glBindTexture")
  LOAD(PFNGLPIXELSTOREIPROC, pixel_store, "glPixelStorei")
  LOAD(PFNGLTEXIMAGE2DPROC, tex_image, "glTexImage2D")
  LOAD(PFNGLTEXPARAMETERIPROC, tex_parameter, "glTexParameteri")
  LOAD(PFNGLGENFRAMEBUFFERSPROC, gen_framebuffers, "glGenFramebuffers")
  LOAD(PFNGLDELETEFRAMEBUFFERSPROC, delete_framebuffers, "glDeleteFramebuffers")
  LOAD(PFNGLBINDFRAMEBUFFERPROC, bind_framebuffer, "glBindFramebuffer")
  LOAD(PFNGLFRAMEBUFFERTEXTURE2DPROC, framebuffer_texture, "glFramebufferTexture2D")
  LOAD(PFNGLREADPIXELSPROC, read_pixels, "glReadPixels")
#undef LOAD
  eventcamera::LumaFormat format_;
  int channels_;
  GLuint name_ = 0;
};

}  // namespace gl_test
