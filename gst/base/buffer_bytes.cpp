// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/buffer_bytes.hpp"

#include <algorithm>
#include <utility>

GstBuffer* copied_buffer(std::span<const std::byte> bytes) {
  auto* const memory = static_cast<std::byte*>(g_try_malloc(bytes.size()));
  if (memory == nullptr) throw std::bad_alloc();
  std::ranges::copy(bytes, memory);
  return gst_buffer_new_wrapped(memory, bytes.size());
}

GstBuffer* owning_buffer(std::vector<std::uint8_t> bytes) {
  using Bytes = std::vector<std::uint8_t>;
  auto owner = std::make_unique<Bytes>(std::move(bytes));
  const gsize size = owner->size();
  auto* const data = owner->data();
  return gst_buffer_new_wrapped_full(
      GST_MEMORY_FLAG_READONLY, data, size, 0, size, owner.release(),
      [](gpointer vector) { const std::unique_ptr<Bytes> last(static_cast<Bytes*>(vector)); });
}

MappedBytes::MappedBytes(GstElement* element, OwnedBuffer buffer)
    : buffer_(std::move(buffer)),
      is_mapped_(gst_buffer_map(buffer_.get(), &map_, GST_MAP_READ) != FALSE) {
  if (is_mapped_) return;
  GST_ELEMENT_ERROR(element, RESOURCE, READ, ("Cannot read a buffer from the file."),
                    ("gst_buffer_map() for reading failed at byte %" G_GUINT64_FORMAT,
                     GST_BUFFER_OFFSET(buffer_.get())));
}

MappedBytes::~MappedBytes() {
  if (is_mapped_) gst_buffer_unmap(buffer_.get(), &map_);
}
