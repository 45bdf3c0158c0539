// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/owned.hpp"

/// Makes a pool of event buffers, whose size varies between intervals. Acquired buffers are empty;
/// event_pool_reserve() allocates the memory, which a buffer keeps when it returns to the pool.
/// Memory is freed when no interval has needed as much for a while, or when too much is idle.
GstBufferPool* event_pool_new();

/// Allocates `size` > 0 bytes to write in an empty buffer of such a pool. Throws std::bad_alloc.
/// Not thread-safe.
void event_pool_reserve(GstBuffer* buffer, gsize size);

/// Event buffers of one stream, from a private pool. Not thread-safe.
class EventBuffers {
 public:
  EventBuffers() = default;
  ~EventBuffers() { reset(); }
  EventBuffers(const EventBuffers&) = delete;
  EventBuffers& operator=(const EventBuffers&) = delete;

  /// Acquires a buffer of `size` > 0 bytes to write. Throws std::bad_alloc.
  OwnedBuffer acquire(gsize size);

  /// Drops the pool, which is freed once all buffers have returned.
  void reset();

 private:
  OwnedBufferPool pool_;  ///< null before the first buffer
};

/// Name of the type in the plugin that this library is linked to. Each plugin defines its own.
extern const char* const event_pool_type_name;
