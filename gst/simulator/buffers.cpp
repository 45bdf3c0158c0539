// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/buffers.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <new>

#include "gst/base/types.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/simulator/caps.hpp"
#include "gst/simulator/eventsimulator.hpp"

using eventcamera::EventBuckets;
using eventcamera::ThreadPool;

/* a pool of event buffers */

/// A pool of event buffers, whose size varies between intervals. Acquired buffers are empty;
/// reserve() allocates the memory, which a buffer keeps when it returns to the pool. Memory is
/// freed when no interval has needed as much for a while, or when too much is idle.
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
      register_type(GST_TYPE_BUFFER_POOL, event_simulator_type_names.pool,
                    gst_event_pool_class_init, gst_event_pool_init, static_cast<GTypeFlags>(0));
  return type;
}

/// Gives an empty buffer of the pool `size` > 0 bytes to write. False if out of memory. Not
/// thread-safe.
static bool reserve(GstBuffer* buffer, gsize size) {
  gsize& needed = GST_EVENT_POOL(buffer->pool)->needed;
  needed = std::max(size, needed - needed / 64);
  const gsize wanted = std::bit_ceil(std::max(needed, min_capacity));
  const gsize capacity = capacity_of(buffer);
  if (capacity < size || capacity / 4 > wanted) {
    gst_buffer_remove_all_memory(buffer);
    // GStreamer's own allocator would abort the process when out of memory.
    void* memory = g_try_malloc(wanted);
    if (memory == nullptr) return false;
    gst_buffer_append_memory(buffer, gst_memory_new_wrapped(static_cast<GstMemoryFlags>(0), memory,
                                                            wanted, 0, wanted, memory, g_free));
    // Keep this memory with the buffer when it returns to the pool.
    GST_BUFFER_FLAG_UNSET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  }
  gst_buffer_set_size(buffer, static_cast<gssize>(size));
  return true;
}

/* negotiation */

/// Default virtual functions of GstBaseTransform.
static const GstBaseTransformClass* base_class() {
  return GST_BASE_TRANSFORM_CLASS(g_type_class_peek(GST_TYPE_BASE_TRANSFORM));
}

static gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE,
                                nullptr);  // any stride is supported
  return base_class()->propose_allocation(transform, decide, query);
}

/// Always uses a GstEventPool, because downstream's pools have buffers of a fixed size.
static void decide_on_event_pool(GstQuery* query) {
  while (gst_query_get_n_allocation_pools(query) > 0)
    gst_query_remove_nth_allocation_pool(query, 0);
  auto* pool =
      GST_BUFFER_POOL(gst_object_ref_sink(g_object_new(gst_event_pool_get_type(), nullptr)));
  gst_query_add_allocation_pool(query, pool, 0, 0, 0);
  gst_object_unref(pool);
}

static gboolean decide_allocation(GstBaseTransform* transform, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  if (!event_simulator_draws(caps))
    decide_on_event_pool(query);
  else if (!decide_on_drawn_pool(query, caps))
    return FALSE;
  return base_class()->decide_allocation(transform, query);
}

static gboolean transform_size(GstBaseTransform*, GstPadDirection direction, GstCaps*, gsize,
                               GstCaps* other, gsize* other_size) {
  GstVideoInfo drawn;
  if (direction != GST_PAD_SINK || !event_simulator_draws(other) ||
      !gst_video_info_from_caps(&drawn, other))
    return FALSE;
  *other_size = GST_VIDEO_INFO_SIZE(&drawn);
  return TRUE;
}

/// Copies nothing: intervals inherit no metadata from the frame that ends them.
static gboolean copy_no_metadata(GstBaseTransform*, GstBuffer*, GstBuffer*) {
  return TRUE;
}

/// Never called, because generate_output() is overridden. GstBaseTransform allocates output buffers
/// only for classes that have a transform().
static GstFlowReturn transform_not_in_place(GstBaseTransform*, GstBuffer*, GstBuffer*) {
  return GST_FLOW_NOT_SUPPORTED;
}

void event_simulator_class_install_buffers(GstBaseTransformClass* klass) {
  klass->propose_allocation = propose_allocation;
  klass->decide_allocation = decide_allocation;
  klass->transform_size = transform_size;
  klass->copy_metadata = copy_no_metadata;
  klass->transform = transform_not_in_place;
}

/* intervals */

GstFlowReturn event_simulator_write_events(GstBaseTransform* transform, const EventBuckets& events,
                                           ThreadPool& threads, GstBuffer* in, OwnedBuffer& out) {
  GstBuffer* prepared = nullptr;
  const GstFlowReturn result = base_class()->prepare_output_buffer(transform, in, &prepared);
  if (result != GST_FLOW_OK) return result;
  out.reset(prepared);
  GstMapInfo map;
  if (!reserve(prepared, events.size() * sizeof(eventcamera::Event)) ||
      !gst_buffer_map(prepared, &map, GST_MAP_WRITE))
    throw std::bad_alloc();
  events.write_to(reinterpret_cast<eventcamera::Event*>(map.data), threads);
  gst_buffer_unmap(prepared, &map);
  return GST_FLOW_OK;
}

GstFlowReturn event_simulator_make_picture(GstBaseTransform* transform, GstBuffer* in,
                                           OwnedBuffer& picture) {
  GstBuffer* prepared = nullptr;
  const GstFlowReturn result = base_class()->prepare_output_buffer(transform, in, &prepared);
  if (result != GST_FLOW_OK) return result;
  picture.reset(prepared);
  keep_metas(in, prepared);
  return GST_FLOW_OK;
}
