// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>

/// Owning pointers to GStreamer objects.

struct Unref {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
  void operator()(GstBufferList* list) const { gst_buffer_list_unref(list); }
  void operator()(GstBufferPool* pool) const { gst_object_unref(pool); }
  void operator()(GstCaps* caps) const { gst_caps_unref(caps); }
  void operator()(GstElement* element) const { gst_object_unref(element); }
  void operator()(GstEvent* event) const { gst_event_unref(event); }
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
};

struct UnrefObject {
  void operator()(gpointer object) const { g_object_unref(object); }
};

using OwnedBuffer = std::unique_ptr<GstBuffer, Unref>;
using OwnedBufferPool = std::unique_ptr<GstBufferPool, Unref>;
using OwnedCaps = std::unique_ptr<GstCaps, Unref>;
using OwnedElement = std::unique_ptr<GstElement, Unref>;
using OwnedEvent = std::unique_ptr<GstEvent, Unref>;
using OwnedPad = std::unique_ptr<GstPad, Unref>;
