// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/buffer.hpp"

#include <cstring>
#include <string>
#include <vector>

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

void Buffer::assign(std::span<const std::byte> bytes) {
  reserve(bytes.size());
  gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, name_);
  gl_.BufferSubData(GL_SHADER_STORAGE_BUFFER, 0, static_cast<GLsizeiptr>(bytes.size()),
                    bytes.data());
}

void Buffer::assign_zeros(std::size_t size) {
  assign(std::vector<std::byte>(size));
}

void Buffer::read(std::span<std::byte> out) const {
  if (out.empty()) return;
  gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, name_);
  const auto size = static_cast<GLsizeiptr>(out.size());
  const void* mapped = gl_.MapBufferRange(GL_SHADER_STORAGE_BUFFER, 0, size, GL_MAP_READ_BIT);
  if (mapped == nullptr) {
    gl_.check();
    throw Error("cannot map an OpenGL buffer");
  }
  std::memcpy(out.data(), mapped, out.size());
  gl_.UnmapBuffer(GL_SHADER_STORAGE_BUFFER);
}

}  // namespace eventcamera::gl
