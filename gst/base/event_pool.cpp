// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/event_pool.hpp"

#include <algorithm>
#include <atomic>
#include <bit>

namespace {

/// Buffers that return when this much lies idle are freed, unless they are all there is.
constexpr gsize max_idle = gsize{64} << 20;

constexpr gsize min_room = 4096;

struct EventPool {
  GstBufferPool parent;
  std::atomic<gsize> idle;  ///< bytes that buffers in the pool have kept
  gsize needed;             ///< by a recent interval: what was the most, and fades
};

struct EventPoolClass {
  GstBufferPoolClass parent_class;
};

G_DEFINE_TYPE(EventPool, event_pool, GST_TYPE_BUFFER_POOL)

EventPool* event_pool(GstBufferPool* pool) {
  return reinterpret_cast<EventPool*>(pool);
}

gsize room_of(GstBuffer* buffer) {
  gsize room = 0;
  gst_buffer_get_sizes(buffer, nullptr, &room);
  return room;
}

GstFlowReturn acquire_buffer(GstBufferPool* pool, GstBuffer** buffer,
                             GstBufferPoolAcquireParams* params) {
  const GstFlowReturn result =
      GST_BUFFER_POOL_CLASS(event_pool_parent_class)->acquire_buffer(pool, buffer, params);
  if (result == GST_FLOW_OK) event_pool(pool)->idle -= room_of(*buffer);
  return result;
}

void release_buffer(GstBufferPool* pool, GstBuffer* buffer) {
  auto& idle = event_pool(pool)->idle;
  const gsize room = room_of(buffer);
  // A buffer whose memory is not as it was is freed, and so is this one.
  if (idle > 0 && idle + room > max_idle) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  if (!GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY) &&
      gst_buffer_is_all_memory_writable(buffer))
    idle += room;
  GST_BUFFER_POOL_CLASS(event_pool_parent_class)->release_buffer(pool, buffer);
}

gboolean stop(GstBufferPool* pool) {
  event_pool(pool)->idle = 0;
  return GST_BUFFER_POOL_CLASS(event_pool_parent_class)->stop(pool);
}

void event_pool_init(EventPool*) {}

void event_pool_class_init(EventPoolClass* klass) {
  GstBufferPoolClass* pool_class = GST_BUFFER_POOL_CLASS(klass);
  pool_class->acquire_buffer = acquire_buffer;
  pool_class->release_buffer = release_buffer;
  pool_class->stop = stop;
}

}  // namespace

GstBufferPool* event_pool_new() {
  auto* pool = GST_BUFFER_POOL(g_object_new(event_pool_get_type(), nullptr));
  gst_object_ref_sink(pool);
  return pool;
}

bool event_pool_make_room(GstBuffer* buffer, gsize size) {
  gsize& needed = event_pool(buffer->pool)->needed;
  needed = std::max(size, needed - needed / 64);
  const gsize wanted = std::bit_ceil(std::max(needed, min_room));
  const gsize room = room_of(buffer);
  if (room < size || room / 4 > wanted) {
    gst_buffer_remove_all_memory(buffer);
    // GStreamer's own allocation would end the process where memory is short.
    void* memory = g_try_malloc(wanted);
    if (memory == nullptr) return false;
    gst_buffer_append_memory(buffer, gst_memory_new_wrapped(static_cast<GstMemoryFlags>(0), memory,
                                                            wanted, 0, wanted, memory, g_free));
    // The memory is the buffer's own, as if it had come with it.
    GST_BUFFER_FLAG_UNSET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  }
  gst_buffer_set_size(buffer, static_cast<gssize>(size));
  return true;
}
