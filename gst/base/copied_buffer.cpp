// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/copied_buffer.hpp"

#include <algorithm>
#include <new>

GstBuffer* copied_buffer(std::span<const std::byte> bytes) {
  auto* const memory = static_cast<std::byte*>(g_try_malloc(bytes.size()));
  if (memory == nullptr) throw std::bad_alloc();
  std::ranges::copy(bytes, memory);
  return gst_buffer_new_wrapped(memory, bytes.size());
}
