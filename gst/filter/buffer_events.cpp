// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/filter/buffer_events.hpp"

#include <cstdint>
#include <new>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"

using eventcamera::Event;

BufferEvents::BufferEvents(GstBuffer* buffer) : buffer_(buffer) {
  if (!gst_buffer_map(buffer, &map_, GST_MAP_READWRITE)) throw std::bad_alloc();
  if (reinterpret_cast<std::uintptr_t>(map_.data) % alignof(Event) == 0) return;
  // Bytes from elsewhere may begin anywhere: copy them to an aligned address.
  const OwnedBuffer copy([&] {
    try {
      return copied_buffer(std::as_bytes(std::span(map_.data, map_.size)));
    } catch (...) {
      unmap();
      throw;
    }
  }());
  unmap();
  gst_buffer_replace_all_memory(buffer, gst_buffer_get_memory(copy.get(), 0));
  if (!gst_buffer_map(buffer, &map_, GST_MAP_READWRITE)) throw std::bad_alloc();
}

void BufferEvents::unmap() {
  if (map_.memory != nullptr) gst_buffer_unmap(buffer_, &map_);
  map_ = {};
}

eventcamera::LabelledEvents BufferEvents::events() const {
  return {{reinterpret_cast<Event*>(map_.data), map_.size / sizeof(Event)}, labels_of(buffer_)};
}

void BufferEvents::keep(std::size_t count) {
  unmap();
  truncate_events(buffer_, count);
}
