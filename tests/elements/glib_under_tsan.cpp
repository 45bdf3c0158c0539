// SPDX-License-Identifier: LGPL-2.1-or-later
// Tells ThreadSanitizer what GLib's locks guard, and what its queues hand on: they are futexes, of
// which it sees nothing. Linked into a test these stand before GLib's own, which they call.
#include <dlfcn.h>
#include <glib-object.h>
#include <sanitizer/tsan_interface.h>

namespace {

/// The function of that name that stands behind the one here.
template <class Function>
Function* behind(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

#define BEHIND(function) static auto* const real = behind(function, #function)

#pragma GCC visibility push(default)
extern "C" {

void g_mutex_lock(GMutex* mutex) {
  BEHIND(g_mutex_lock);
  real(mutex);
  __tsan_acquire(mutex);
}

gboolean g_mutex_trylock(GMutex* mutex) {
  BEHIND(g_mutex_trylock);
  const gboolean locked = real(mutex);
  if (locked) __tsan_acquire(mutex);
  return locked;
}

void g_mutex_unlock(GMutex* mutex) {
  BEHIND(g_mutex_unlock);
  __tsan_release(mutex);
  real(mutex);
}

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

void g_rec_mutex_lock(GRecMutex* mutex) {
  BEHIND(g_rec_mutex_lock);
  real(mutex);
  __tsan_acquire(mutex);
}

gboolean g_rec_mutex_trylock(GRecMutex* mutex) {
  BEHIND(g_rec_mutex_trylock);
  const gboolean locked = real(mutex);
  if (locked) __tsan_acquire(mutex);
  return locked;
}

void g_rec_mutex_unlock(GRecMutex* mutex) {
  BEHIND(g_rec_mutex_unlock);
  __tsan_release(mutex);
  real(mutex);
}

void g_async_queue_push(GAsyncQueue* queue, gpointer data) {
  BEHIND(g_async_queue_push);
  __tsan_release(queue);
  real(queue, data);
}

gpointer g_async_queue_pop(GAsyncQueue* queue) {
  BEHIND(g_async_queue_pop);
  gpointer data = real(queue);
  __tsan_acquire(queue);
  return data;
}

gpointer g_async_queue_try_pop(GAsyncQueue* queue) {
  BEHIND(g_async_queue_try_pop);
  gpointer data = real(queue);
  __tsan_acquire(queue);
  return data;
}

gpointer g_async_queue_timeout_pop(GAsyncQueue* queue, guint64 timeout) {
  BEHIND(g_async_queue_timeout_pop);
  gpointer data = real(queue, timeout);
  __tsan_acquire(queue);
  return data;
}

}  // extern "C"
#pragma GCC visibility pop
