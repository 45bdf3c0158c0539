// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/kernel.hpp"

#include <string>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

/// Log of a shader or program, from the functions that return its length and its text.
template <class GetParameter, class GetLog>
std::string log_of(GLuint object, GetParameter get_parameter, GetLog get_log) {
  GLint length = 0;
  get_parameter(object, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(length), '\0');
  if (length > 0) get_log(object, length, &length, log.data());
  log.resize(static_cast<std::size_t>(length));
  return log;
}

}  // namespace

Kernel::Kernel(const Context& gl, std::string_view name, std::string_view source)
    : gl_(gl), program_(gl.CreateProgram()) {
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
  gl_.UseProgram(program_);
  GLuint binding = 0;
  for (const auto* buffer : buffers)
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding++, buffer->name());
  GLint location = 0;
  for (const int value : values) gl_.Uniform1i(location++, value);
  gl_.DispatchCompute(static_cast<GLuint>(groups.x), static_cast<GLuint>(groups.y), 1);
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

}  // namespace eventcamera::gl
