// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <span>

#include "gst/base/owned.hpp"

/// Makes a buffer of a copy of these bytes. Throws std::bad_alloc, where GStreamer's own allocation
/// would end the process.
GstBuffer* copied_buffer(std::span<const std::byte> bytes);

/// The bytes of a file's buffer, mapped for reading. If that fails, the element posts an error.
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
