// SPDX-License-Identifier: LGPL-2.1-or-later
// Makes the synchronization by GLib's locks and queues, and by GStreamer's buffer pools, visible to
// ThreadSanitizer, which does not see futexes, nor atomics in libraries without it. Linked into a
// test, these functions replace theirs, and call them.
#include <dlfcn.h>
#include <glib-object.h>
#include <gst/gst.h>
#include <sanitizer/tsan_interface.h>

namespace {

/// The library's function of this name, which is replaced here.
template <class Function>
Function* behind(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

#define BEHIND(function) static auto* const real = behind(function, #function)

#pragma GCC visibility push(default)
extern "C" {

#define GUARD_LOCK(name, Type)           \
  void name##_lock(Type* mutex) {        \
    BEHIND(name##_lock);                 \
    real(mutex);                         \
    __tsan_acquire(mutex);               \
  }                                      \
  gboolean name##_trylock(Type* mutex) { \
    BEHIND(name##_trylock);              \
    const gboolean locked = real(mutex); \
    if (locked) __tsan_acquire(mutex);   \
    return locked;                       \
  }                                      \
  void name##_unlock(Type* mutex) {      \
    BEHIND(name##_unlock);               \
    __tsan_release(mutex);               \
    real(mutex);                         \
  }
GUARD_LOCK(g_mutex, GMutex)
GUARD_LOCK(g_rec_mutex, GRecMutex)

void g_cond_wait(GCond* condition, GMutex* mutex) {
  BEHIND(g_cond_wait);
  __tsan_release(mutex);
  real(condition, mutex);
  __tsan_acquire(mutex);
}

gboolean g_cond_wait_until(GCond* condition, GMutex* mutex, gint64 end_time) {
  BEHIND(g_cond_wait_until);
  __tsan_release(mutex);
  const gboolean woken = real(condition, mutex, end_time);
  __tsan_acquire(mutex);
  return woken;
}

void g_async_queue_push(GAsyncQueue* queue, gpointer data) {
  BEHIND(g_async_queue_push);
  __tsan_release(queue);
  real(queue, data);
}

#define GUARD_POP(name)               \
  gpointer name(GAsyncQueue* queue) { \
    BEHIND(name);                     \
    gpointer data = real(queue);      \
    __tsan_acquire(queue);            \
    return data;                      \
  }
GUARD_POP(g_async_queue_pop)
GUARD_POP(g_async_queue_try_pop)

gpointer g_async_queue_timeout_pop(GAsyncQueue* queue, guint64 timeout) {
  BEHIND(g_async_queue_timeout_pop);
  gpointer data = real(queue, timeout);
  __tsan_acquire(queue);
  return data;
}

// A pool hands a buffer that was released last in one thread to another.
void gst_mini_object_unref(GstMiniObject* object) {
  BEHIND(gst_mini_object_unref);
  __tsan_release(object);
  real(object);
}

GstFlowReturn gst_buffer_pool_acquire_buffer(GstBufferPool* pool, GstBuffer** buffer,
                                             GstBufferPoolAcquireParams* params) {
  BEHIND(gst_buffer_pool_acquire_buffer);
  const auto result = real(pool, buffer, params);
  if (result == GST_FLOW_OK) __tsan_acquire(*buffer);
  return result;
}

}  // extern "C"
#pragma GCC visibility pop
