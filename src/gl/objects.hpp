// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string_view>

#include "src/core/luma.hpp"
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

  /// Grows the buffer to at least `size` bytes; growing loses its contents. Throws Error.
  void reserve(std::size_t size);

  /// Replaces the contents from `offset` on, after reserve().
  void assign(std::span<const std::byte> bytes, std::size_t offset = 0);

  void assign_zeros(std::size_t size);

  /// Like reserve(), but a buffer that grows contains zeros.
  void reserve_zeros(std::size_t size) {
    if (size > size_) assign_zeros(size);
  }

  /// Waits for the GPU and copies bytes from `offset` on to `out`. Throws Error if the context is
  /// lost.
  void read(std::span<std::byte> out, std::size_t offset = 0) const;

 private:
  const Context& gl_;
  GLenum usage_;
  GLuint name_ = 0;
  std::size_t size_ = 0;
};

struct Groups {
  int x = 1;
  int y = 1;
  int z = 1;
};

/// Number of groups of `size` that cover `count`.
constexpr int groups_of(int size, int count) {
  return (count + size - 1) / size;
}

class Kernel {
 public:
  /// `name` is for error messages and measurements, and must outlive this object. The source has no
  /// #version, and may use shaders/prelude.comp. Throws Error if it does not compile.
  Kernel(const Context& gl, std::string_view name, std::string_view source);
  ~Kernel() { gl_.DeleteProgram(program_); }
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

  /// Queues a run with `buffers` at bindings 0, 1, ... and the integers `values` at uniform
  /// locations 0, 1, ... Kernels run one after another, and see what earlier ones wrote.
  void run(Groups groups, std::initializer_list<const Buffer*> buffers,
           std::initializer_list<int> values) const;

 private:
  const Context& gl_;
  std::string_view name_;
  GLuint program_;
};

/// A point in the GPU's command queue.
class Fence {
 public:
  explicit Fence(const Context& gl) : gl_(gl) {}
  ~Fence() { clear(); }
  Fence(const Fence&) = delete;
  Fence& operator=(const Fence&) = delete;

  /// Moves the fence to the end of the queue.
  void set();

  /// Waits until the GPU has reached the fence. Throws Error.
  void wait() const;

  /// Like wait(), but needs no context, so another thread may call it. Does not report errors, and
  /// returns at once if the context is not one of EGL.
  void wait_without_context() const;

 private:
  void clear();

  const Context& gl_;
  GLsync sync_ = nullptr;
  EGLSyncKHR egl_sync_ = EGL_NO_SYNC_KHR;  ///< instead of sync_, with EGL
};

/// Input frame of a simulator, a 2D texture of bytes.
struct TextureFrame {
  LumaFormat format;
  GLuint texture;
  /// Weights of the four channels in luma, in units of 1/LumaWeights::one. Their sum is
  /// LumaWeights::one.
  int weights[4];
  int alpha = -1;  ///< channel of alpha; -1: opaque
  int black = 0;   ///< luma of black, on which the frame is composited
};

inline std::size_t pixel_count(const LumaFormat& format) {
  return static_cast<std::size_t>(format.width) * static_cast<std::size_t>(format.height);
}

/// The luma of a frame: bytes, four per word; each row starts with a new word.
class GreyFrame {
 public:
  GreyFrame(const Context& gl, const LumaFormat& format) : buffer_(gl) {
    buffer_.reserve(static_cast<std::size_t>(words_across(format.width)) *
                    static_cast<std::size_t>(format.height) * 4);
  }

  static int words_across(int width) { return groups_of(4, width); }
  const Buffer& buffer() const { return buffer_; }

 private:
  Buffer buffer_;
};

}  // namespace eventcamera::gl
