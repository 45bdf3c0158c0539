// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <vector>

#include "gst/base/owned.hpp"
#include "src/core/event.hpp"

/// Returns a new buffer with a copy of `bytes`. Throws std::bad_alloc; GStreamer's own allocator
/// would abort the process.
GstBuffer* copied_buffer(std::span<const std::byte> bytes);

/// Returns a new buffer that owns `bytes`. Throws std::bad_alloc.
GstBuffer* owning_buffer(std::vector<std::uint8_t> bytes);

/// Maps a buffer that is part of a file for reading. Posts an error on the element if that fails.
class MappedBytes {
 public:
  MappedBytes(GstElement* element, OwnedBuffer buffer);
  ~MappedBytes();
  MappedBytes(const MappedBytes&) = delete;
  MappedBytes& operator=(const MappedBytes&) = delete;

  bool is_mapped() const { return is_mapped_; }
  std::span<const std::uint8_t> get() const { return {map_.data, map_.size}; }

 private:
  OwnedBuffer buffer_;
  GstMapInfo map_ = {};
  bool is_mapped_;
};

/// Maps a buffer for writing, for as long as it lives; an exception unmaps it, too.
class WritableBytes {
 public:
  /// Throws std::bad_alloc if the buffer cannot be mapped.
  explicit WritableBytes(GstBuffer* buffer, GstMapFlags flags = GST_MAP_WRITE) : buffer_(buffer) {
    if (!gst_buffer_map(buffer, &map_, flags)) throw std::bad_alloc();
  }
  ~WritableBytes() { gst_buffer_unmap(buffer_, &map_); }
  WritableBytes(const WritableBytes&) = delete;
  WritableBytes& operator=(const WritableBytes&) = delete;

  std::span<std::byte> get() const { return {reinterpret_cast<std::byte*>(map_.data), map_.size}; }
  std::span<eventcamera::Event> events() const {
    return {reinterpret_cast<eventcamera::Event*>(map_.data),
            map_.size / sizeof(eventcamera::Event)};
  }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_ = {};
};
