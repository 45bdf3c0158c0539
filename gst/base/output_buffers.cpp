// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/output_buffers.hpp"

#include <new>

#include "gst/base/drawn_video.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/output_caps.hpp"
#include "gst/base/video_frame.hpp"

using eventcamera::EventBuckets;
using eventcamera::ThreadPool;

/// GstBaseTransform's own doing.
static const GstBaseTransformClass* base_class() {
  return GST_BASE_TRANSFORM_CLASS(g_type_class_peek(GST_TYPE_BASE_TRANSFORM));
}

/* negotiation */

static gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);  // any stride is welcome
  return base_class()->propose_allocation(transform, decide, query);
}

/// Events come from a pool of ours, whatever downstream has: their buffers are of any size.
static void decide_on_event_pool(GstQuery* query) {
  while (gst_query_get_n_allocation_pools(query) > 0)
    gst_query_remove_nth_allocation_pool(query, 0);
  GstBufferPool* pool = event_pool_new();
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

/// An interval has nothing of the frame that ends it.
static gboolean copy_no_metadata(GstBaseTransform*, GstBuffer*, GstBuffer*) {
  return TRUE;
}

/// Never called: the simulators have a generate_output(), which does it all. But only a class that
/// has one gets buffers of its own to write to, instead of its input's.
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
                                           ThreadPool& threads, GstBuffer* in, GstBuffer** out) {
  GstBuffer* buffer = nullptr;
  const GstFlowReturn result = base_class()->prepare_output_buffer(transform, in, &buffer);
  if (result != GST_FLOW_OK) return result;
  GstMapInfo map;
  if (!event_pool_make_room(buffer, events.size() * sizeof(eventcamera::Event)) ||
      !gst_buffer_map(buffer, &map, GST_MAP_WRITE)) {
    gst_buffer_unref(buffer);
    throw std::bad_alloc();
  }
  events.copy_to(reinterpret_cast<eventcamera::Event*>(map.data), threads);
  gst_buffer_unmap(buffer, &map);
  *out = buffer;
  return GST_FLOW_OK;
}

GstFlowReturn event_simulator_draw_events(GstBaseTransform* transform, const EventBuckets& events,
                                          Drawing& drawing, const eventcamera::Palette& palette,
                                          ThreadPool& threads, GstBuffer* in, GstBuffer** out) {
  GstBuffer* buffer = nullptr;
  const GstFlowReturn result = base_class()->prepare_output_buffer(transform, in, &buffer);
  if (result != GST_FLOW_OK) return result;
  {
    const VideoFrame picture(drawing.video, buffer, GST_MAP_WRITE);
    if (!picture) {
      gst_buffer_unref(buffer);
      GST_ELEMENT_ERROR(transform, RESOURCE, FAILED, ("A buffer could not be mapped for drawing."),
                        (nullptr));
      return GST_FLOW_ERROR;
    }
    drawing.accumulator.add(events, threads);
    drawing.accumulator.draw(palette, pixel_layout_of(drawing.video), picture.data(),
                             picture.stride());
  }
  *out = buffer;
  return GST_FLOW_OK;
}
