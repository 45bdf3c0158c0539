// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <span>
#include <vector>

#include "gst/base/owned.hpp"

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
