// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "src/core/label.hpp"

/// Events of a buffer, with their labels if it has any, mapped to be changed in place. The buffer
/// must be writable and hold no partial event. Throws std::bad_alloc if it cannot be mapped.
class BufferEvents {
 public:
  explicit BufferEvents(GstBuffer* buffer);
  ~BufferEvents() { unmap(); }
  BufferEvents(const BufferEvents&) = delete;
  BufferEvents& operator=(const BufferEvents&) = delete;

  eventcamera::LabelledEvents events() const;

  /// Shortens the buffer to its first `count` events. Nothing may be accessed afterwards.
  void keep(std::size_t count);

 private:
  void unmap();

  GstBuffer* buffer_;
  GstMapInfo map_{};
};
