// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>

#include "src/gl/context.hpp"

namespace eventcamera::gl {

/// GPU memory that shaders read and write.
class Buffer {
 public:
  /// `usage`: GL_DYNAMIC_COPY for data that stay on the GPU, GL_DYNAMIC_READ for data to read back.
  explicit Buffer(const Context& gl, GLenum usage = GL_DYNAMIC_COPY);
  ~Buffer() { gl_.DeleteBuffers(1, &name_); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  GLuint name() const { return name_; }
  std::size_t size() const { return size_; }

  /// Makes it at least `size` bytes long; if it must grow, its contents are lost. Throws Error.
  void reserve(std::size_t size);

  /// Replaces the contents.
  void assign(std::span<const std::byte> bytes);

  /// Replaces the contents by `size` zeros.
  void assign_zeros(std::size_t size);

  /// Copies the first bytes to `out`, once the GPU has written them. Throws Error if the context is
  /// lost.
  void read(std::span<std::byte> out) const;

 private:
  const Context& gl_;
  GLenum usage_;
  GLuint name_ = 0;
  std::size_t size_ = 0;
};

}  // namespace eventcamera::gl
