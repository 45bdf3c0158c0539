// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <initializer_list>
#include <string_view>

#include "src/gl/buffer.hpp"
#include "src/gl/context.hpp"

namespace eventcamera::gl {

/// Number of workgroups along each axis.
struct Groups {
  int x = 1;
  int y = 1;
};

/// Number of groups of `size` that cover `count`.
constexpr int groups_of(int size, int count) {
  return (count + size - 1) / size;
}

/// A compute shader.
class Kernel {
 public:
  /// `name` is for error messages. The source has no #version, and may use
  /// shaders/prelude.comp. Throws Error if it does not compile.
  Kernel(const Context& gl, std::string_view name, std::string_view source);
  ~Kernel() { gl_.DeleteProgram(program_); }
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

  /// Runs it with `buffers` at bindings 0, 1, ... and the integers `values` at uniform locations 0,
  /// 1, ... Kernels run one after another, and see what earlier ones wrote.
  void run(Groups groups, std::initializer_list<const Buffer*> buffers,
           std::initializer_list<int> values) const;

 private:
  const Context& gl_;
  GLuint program_;
};

}  // namespace eventcamera::gl
