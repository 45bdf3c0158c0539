// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/buffers.hpp"

#include <new>

#include "gst/base/event_buffer.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/drawing/drawn_video.hpp"
#include "gst/simulator/caps.hpp"

using eventcamera::Event;
using eventcamera::EventBuckets;
using eventcamera::IntervalSimulator;

/* negotiation */

/// Default virtual functions of GstBaseTransform.
static const GstBaseTransformClass* base_class() {
  return GST_BASE_TRANSFORM_CLASS(g_type_class_peek(GST_TYPE_BASE_TRANSFORM));
}

static gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE,
                                nullptr);  // any stride is supported
  GstAllocationParams params;
  gst_allocation_params_init(&params);
  params.align = 63;  // vectors of pixels do not straddle cache lines
  gst_query_add_allocation_param(query, nullptr, &params);
  return base_class()->propose_allocation(transform, decide, query);
}

/// Always uses a GstEventPool, because downstream's pools have buffers of a fixed size.
static void decide_on_event_pool(GstQuery* query) {
  while (gst_query_get_n_allocation_pools(query) > 0)
    gst_query_remove_nth_allocation_pool(query, 0);
  auto* pool = event_pool_new();
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
                                           IntervalSimulator& simulator, GstBuffer* in,
                                           OwnedBuffer& out) {
  GstBuffer* prepared = nullptr;
  const GstFlowReturn result = base_class()->prepare_output_buffer(transform, in, &prepared);
  if (result != GST_FLOW_OK) return result;
  out.reset(prepared);
  GstMapInfo map;
  event_pool_reserve(prepared, events.size() * sizeof(Event));
  if (!gst_buffer_map(prepared, &map, GST_MAP_WRITE)) throw std::bad_alloc();
  const std::span written(reinterpret_cast<Event*>(map.data), events.size());
  events.write_to(written.data(), simulator.threads());
  if (simulator.has_labels()) simulator.label({written, add_labels(prepared, written.size())});
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
