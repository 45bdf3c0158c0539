// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <new>

/// Maps a buffer for writing. Unmaps it where an exception leaves the scope, too: a buffer that
/// stays mapped must not return to its pool.
class WriteMap {
 public:
  /// Throws std::bad_alloc if the buffer cannot be mapped.
  explicit WriteMap(GstBuffer* buffer) : buffer_(buffer) {
    if (!gst_buffer_map(buffer, &map_, GST_MAP_WRITE)) throw std::bad_alloc();
  }
  ~WriteMap() { gst_buffer_unmap(buffer_, &map_); }
  WriteMap(const WriteMap&) = delete;
  WriteMap& operator=(const WriteMap&) = delete;

  guint8* data() const { return map_.data; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
};
