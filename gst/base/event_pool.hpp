// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// A pool of buffers of events, of which there are many in one interval and few in the next. Its
/// buffers come empty; event_pool_make_room() gives one what memory it needs, which it keeps when
/// it returns. What it has kept goes when no interval has needed as much for a while, or when more
/// lies idle than is good.
GstBufferPool* event_pool_new();

/// Gives an empty buffer of the pool `size` bytes, for the caller to write; more than 0. False
/// where memory is short. From one thread at a time.
bool event_pool_make_room(GstBuffer* buffer, gsize size);
