// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/event_pool.hpp"

#include <atomic>
#include <bit>
#include <new>

#include "gst/base/element_type.hpp"

G_DECLARE_FINAL_TYPE(GstEventPool, gst_event_pool, GST, EVENT_POOL, GstBufferPool)

struct _GstEventPool {
  GstBufferPool parent;
  std::atomic<gsize> idle;  ///< bytes in buffers waiting in the pool
  gsize needed;             ///< bytes that a recent interval needed: a maximum that decays
};

static gpointer parent_pool_class;
#define PARENT_POOL_CLASS GST_BUFFER_POOL_CLASS(parent_pool_class)

/// Limit of idle memory in a pool. Returned buffers beyond it are freed, unless the pool is empty.
static constexpr gsize max_idle = gsize{64} << 20;

static constexpr gsize min_capacity = 4096;

static gsize capacity_of(GstBuffer* buffer) {
  gsize capacity = 0;
  gst_buffer_get_sizes(buffer, nullptr, &capacity);
  return capacity;
}

static GstFlowReturn acquire_buffer(GstBufferPool* pool, GstBuffer** buffer,
                                    GstBufferPoolAcquireParams* params) {
  const GstFlowReturn result = PARENT_POOL_CLASS->acquire_buffer(pool, buffer, params);
  if (result == GST_FLOW_OK) GST_EVENT_POOL(pool)->idle -= capacity_of(*buffer);
  return result;
}

static void release_buffer(GstBufferPool* pool, GstBuffer* buffer) {
  auto& idle = GST_EVENT_POOL(pool)->idle;
  const gsize capacity = capacity_of(buffer);
  // This flag makes GstBufferPool free the buffer.
  if (idle > 0 && idle + capacity > max_idle)
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  if (!GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY) &&
      gst_buffer_is_all_memory_writable(buffer))
    idle += capacity;
  PARENT_POOL_CLASS->release_buffer(pool, buffer);
}

static gboolean stop_pool(GstBufferPool* pool) {
  GST_EVENT_POOL(pool)->idle = 0;
  return PARENT_POOL_CLASS->stop(pool);
}

static void gst_event_pool_init(GstEventPool*) {}

static void gst_event_pool_class_init(GstEventPoolClass* klass) {
  parent_pool_class = g_type_class_peek_parent(klass);
  GstBufferPoolClass* pool_class = GST_BUFFER_POOL_CLASS(klass);
  pool_class->acquire_buffer = acquire_buffer;
  pool_class->release_buffer = release_buffer;
  pool_class->stop = stop_pool;
}

GType gst_event_pool_get_type() {
  static const GType type =
      register_type(GST_TYPE_BUFFER_POOL, event_pool_type_name, gst_event_pool_class_init,
                    gst_event_pool_init, static_cast<GTypeFlags>(0));
  return type;
}

GstBufferPool* event_pool_new() {
  return GST_BUFFER_POOL(gst_object_ref_sink(g_object_new(gst_event_pool_get_type(), nullptr)));
}

void event_pool_reserve(GstBuffer* buffer, gsize size) {
  gsize& needed = GST_EVENT_POOL(buffer->pool)->needed;
  needed = std::max(size, needed - needed / 64);
  const gsize wanted = std::bit_ceil(std::max(needed, min_capacity));
  const gsize capacity = capacity_of(buffer);
  if (capacity < size || capacity / 4 > wanted) {
    gst_buffer_remove_all_memory(buffer);
    // GStreamer's own allocator would abort the process when out of memory.
    void* memory = g_try_malloc(wanted);
    if (memory == nullptr) throw std::bad_alloc();
    gst_buffer_append_memory(buffer, gst_memory_new_wrapped(static_cast<GstMemoryFlags>(0), memory,
                                                            wanted, 0, wanted, memory, g_free));
    // Keep this memory with the buffer when it returns to the pool.
    GST_BUFFER_FLAG_UNSET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  }
  gst_buffer_set_size(buffer, static_cast<gssize>(size));
}

OwnedBuffer EventBuffers::acquire(gsize size) {
  if (!pool_) {
    pool_.reset(event_pool_new());
    GstStructure* config = gst_buffer_pool_get_config(pool_.get());
    gst_buffer_pool_config_set_params(config, nullptr, 0, 0, 0);
    if (!gst_buffer_pool_set_config(pool_.get(), config) ||
        !gst_buffer_pool_set_active(pool_.get(), TRUE))
      throw std::bad_alloc();
  }
  GstBuffer* acquired = nullptr;
  if (gst_buffer_pool_acquire_buffer(pool_.get(), &acquired, nullptr) != GST_FLOW_OK)
    throw std::bad_alloc();
  OwnedBuffer buffer(acquired);
  event_pool_reserve(acquired, size);
  return buffer;
}

void EventBuffers::reset() {
  if (pool_) gst_buffer_pool_set_active(pool_.get(), FALSE);
  pool_.reset();
}
