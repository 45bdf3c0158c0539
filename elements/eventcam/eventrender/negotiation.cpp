// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/negotiation.hpp"

#include <new>
#include <optional>

#include "elements/eventcam/eventrender/pictures.hpp"
#include "gst/base/drawn_video.hpp"

namespace eventrender {

GstFlowReturn update_src_caps(GstAggregator* aggregator, GstCaps* downstream, GstCaps** result) {
  const auto& state = event_render(aggregator)->priv->state;
  if (!state) return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstCaps* ours = gst_pad_get_pad_template_caps(GST_AGGREGATOR_SRC_PAD(aggregator));
  ours = gst_caps_make_writable(ours);
  gst_caps_set_simple(ours, "width", G_TYPE_INT, state->events.width, "height", G_TYPE_INT,
                      state->events.height, nullptr);
  *result = gst_caps_intersect_full(downstream, ours, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(ours);
  return gst_caps_is_empty(*result) ? GST_FLOW_NOT_NEGOTIATED : GST_FLOW_OK;
}

GstCaps* fixate_src_caps(GstAggregator*, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, 0), "framerate", 30, 1);
  return gst_caps_fixate(caps);
}

gboolean negotiated_src_caps(GstAggregator* aggregator, GstCaps* caps) {
  auto& priv = *event_render(aggregator)->priv;
  GstVideoInfo video;
  if (!priv.state || !gst_video_info_from_caps(&video, caps)) return FALSE;
  const auto n = GST_VIDEO_INFO_FPS_N(&video);
  const auto d = GST_VIDEO_INFO_FPS_D(&video);
  if (priv.times) {
    const GstClockTime start = priv.times->picture().start;
    priv.times.reset();
    if (n > 0) priv.times.emplace(start, video);
  }
  priv.state->video = video;
  const GstClockTime latency = n > 0 ? gst_util_uint64_scale_int(GST_SECOND, d, n) : 0;
  gst_aggregator_set_latency(aggregator, latency, latency);
  return TRUE;
}

gboolean decide_allocation(GstAggregator*, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  return decide_on_drawn_pool(query, caps);
}

bool take_caps(GstEventRender* self, GstEvent* event) {
  auto& priv = *self->priv;
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    GST_ERROR_OBJECT(self, "cannot draw %" GST_PTR_FORMAT, caps);
    return false;
  }
  if (priv.state && priv.state->events.width == info.width &&
      priv.state->events.height == info.height)
    return true;
  drain(self);
  priv.state.reset();  // before the next is made: pictures can be large
  try {
    priv.state.emplace(
        State{info, std::nullopt,
              eventcamera::Renderer(info.width, info.height, core_settings(settings_of(self)))});
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return false;
  }
  gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(self));
  return true;
}

}  // namespace eventrender
