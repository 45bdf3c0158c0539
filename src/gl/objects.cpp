// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/objects.hpp"

#include <cstring>
#include <string>
#include <vector>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

Buffer::Buffer(const Context& gl, GLenum usage) : gl_(gl), usage_(usage) {
  gl_.GenBuffers(1, &name_);
}

void Buffer::reserve(std::size_t size) {
  if (size <= size_) return;
  if (size > static_cast<std::size_t>(gl_.max_buffer_size()))
    throw Error(
        std::string("the frames are too large, or there are too many interpolated frames: ") +
        "an OpenGL buffer of " + std::to_string(size) + " bytes is needed, the limit is " +
        std::to_string(gl_.max_buffer_size()));
  gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, name_);
  gl_.BufferData(GL_SHADER_STORAGE_BUFFER, static_cast<GLsizeiptr>(size), nullptr, usage_);
  size_ = size;
}

void Buffer::assign(std::span<const std::byte> bytes, std::size_t offset) {
  reserve(offset + bytes.size());
  gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, name_);
  gl_.BufferSubData(GL_SHADER_STORAGE_BUFFER, static_cast<GLintptr>(offset),
                    static_cast<GLsizeiptr>(bytes.size()), bytes.data());
}

void Buffer::assign_zeros(std::size_t size) {
  assign(std::vector<std::byte>(size));
}

void Buffer::read(std::span<std::byte> out, std::size_t offset) const {
  if (out.empty()) return;
  gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, name_);
  const void* mapped = gl_.MapBufferRange(GL_SHADER_STORAGE_BUFFER, static_cast<GLintptr>(offset),
                                          static_cast<GLsizeiptr>(out.size()), GL_MAP_READ_BIT);
  if (mapped == nullptr) {
    gl_.check();
    throw Error("cannot map an OpenGL buffer");
  }
  std::memcpy(out.data(), mapped, out.size());
  gl_.UnmapBuffer(GL_SHADER_STORAGE_BUFFER);
}

/// Log of a shader or program, from the functions that return its length and its text.
template <class GetParameter, class GetLog>
static std::string log_of(GLuint object, GetParameter get_parameter, GetLog get_log) {
  GLint length = 0;
  get_parameter(object, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(length), '\0');
  if (length > 0) get_log(object, length, &length, log.data());
  log.resize(length);
  return log;
}

Kernel::Kernel(const Context& gl, std::string_view name, std::string_view source)
    : gl_(gl), name_(name), program_(gl.CreateProgram()) {
  const GLuint shader = gl.CreateShader(GL_COMPUTE_SHADER);
  const std::string_view version = gl.shader_version();
  const GLchar* const parts[] = {version.data(), shaders::prelude.data(), source.data()};
  const GLint lengths[] = {static_cast<GLint>(version.size()),
                           static_cast<GLint>(shaders::prelude.size()),
                           static_cast<GLint>(source.size())};
  gl.ShaderSource(shader, 3, parts, lengths);
  gl.CompileShader(shader);
  GLint compiled = GL_FALSE;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  std::string log = log_of(shader, gl.GetShaderiv, gl.GetShaderInfoLog);
  GLint linked = GL_FALSE;
  if (compiled != GL_FALSE) {
    gl.AttachShader(program_, shader);
    gl.LinkProgram(program_);
    gl.GetProgramiv(program_, GL_LINK_STATUS, &linked);
    log += log_of(program_, gl.GetProgramiv, gl.GetProgramInfoLog);
  }
  gl.DeleteShader(shader);
  if (linked != GL_FALSE) return;
  gl.DeleteProgram(program_);
  gl.check();
  throw Error("the driver cannot compile the compute shader '" + std::string(name) + "': " + log);
}

void Kernel::run(Groups groups, std::initializer_list<const Buffer*> buffers,
                 std::initializer_list<int> values) const {
  if (gl_.on_kernel) gl_.on_kernel(name_);
  gl_.UseProgram(program_);
  GLuint binding = 0;
  for (const auto* buffer : buffers)
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding++, buffer->name());
  GLint location = 0;
  for (const int value : values) gl_.Uniform1i(location++, value);
  gl_.DispatchCompute(static_cast<GLuint>(groups.x), static_cast<GLuint>(groups.y),
                      static_cast<GLuint>(groups.z));
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

/// Maximum time in which a driver must complete an interval, nanoseconds.
static constexpr GLuint64 patience = 30'000'000'000;

void Fence::clear() {
  if (egl_sync_ != EGL_NO_SYNC_KHR) gl_.DestroySync(gl_.egl_display, egl_sync_);
  if (sync_ != nullptr) gl_.DeleteSync(sync_);
  egl_sync_ = EGL_NO_SYNC_KHR;
  sync_ = nullptr;
}

void Fence::set() {
  clear();
  if (gl_.egl_display != EGL_NO_DISPLAY)
    egl_sync_ = gl_.CreateSync(gl_.egl_display, EGL_SYNC_FENCE_KHR, nullptr);
  if (egl_sync_ == EGL_NO_SYNC_KHR) sync_ = gl_.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl_.Flush();
}

void Fence::wait() const {
  bool has_expired = false;
  bool has_failed = false;
  if (egl_sync_ != EGL_NO_SYNC_KHR) {
    const EGLint state = gl_.WaitForSync(gl_.egl_display, egl_sync_, 0, patience);
    has_expired = state == EGL_TIMEOUT_EXPIRED_KHR;
    has_failed = state == EGL_FALSE;
  } else {
    const GLenum state = gl_.ClientWaitSync(sync_, 0, patience);
    has_expired = state == GL_TIMEOUT_EXPIRED;
    has_failed = state == GL_WAIT_FAILED;
  }
  gl_.check();
  if (has_expired) throw Error("OpenGL has not answered for half a minute");
  if (has_failed) throw Error("OpenGL cannot wait for the GPU");
}

void Fence::wait_without_context() const {
  if (egl_sync_ == EGL_NO_SYNC_KHR) return;
  gl_.WaitForSync(gl_.egl_display, egl_sync_, 0, patience);
  // libEGL of libglvnd frees the data of a thread that ends while the process exits twice.
  if (gl_.GetCurrentContext() == EGL_NO_CONTEXT) gl_.ReleaseThread();
}

}  // namespace eventcamera::gl
