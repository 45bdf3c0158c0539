// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/pictures.hpp"

#include <mutex>
#include <new>
#include <utility>

#include "gst/base/drawn_video.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/video_frame.hpp"

namespace eventrender {

using eventcamera::Microseconds;

/// Whether sinks would drop a picture anyway.
static bool comes_too_late(GstEventRender* self, const EventInterval& picture) {
  const GstSegment segment = segment_of(self);
  const guint64 time = gst_segment_to_running_time(&segment, GST_FORMAT_TIME, picture.start);
  const std::lock_guard lock(self->priv->mutex);
  return GST_CLOCK_TIME_IS_VALID(time) && time < self->priv->earliest;
}

static GstFlowReturn draw(GstEventRender* self, const EventInterval& events, GstBuffer* buffer) {
  auto& state = *self->priv->state;
  const Settings settings = settings_of(self);
  state.renderer.configure(core_settings(settings));
  const VideoFrame frame(*state.video, buffer, GST_MAP_WRITE);
  if (!frame) {
    GST_ELEMENT_ERROR(self, RESOURCE, FAILED, ("A buffer could not be mapped for drawing."),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  state.renderer.draw(window_start(settings, events), static_cast<Microseconds>(events.end / 1000),
                      pixel_layout_of(*state.video), frame.data(), frame.stride());
  return GST_FLOW_OK;
}

static GstFlowReturn acquire_buffer(GstEventRender* self, GstBuffer** buffer) {
  GstBufferPool* pool = gst_aggregator_get_buffer_pool(GST_AGGREGATOR(self));
  if (pool == nullptr) return GST_FLOW_NOT_NEGOTIATED;
  GstFlowReturn result = GST_FLOW_ERROR;
  if (gst_buffer_pool_set_active(pool, TRUE))  // GstAggregator leaves that to us
    result = gst_buffer_pool_acquire_buffer(pool, buffer, nullptr);
  else
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("There are no buffers to draw in."), (nullptr));
  gst_object_unref(pool);
  return result;
}

GstFlowReturn push_picture(GstEventRender* self, const EventInterval& events,
                           const EventInterval& picture) {
  auto* aggregator = GST_AGGREGATOR(self);
  if (comes_too_late(self, picture)) {
    GST_DEBUG_OBJECT(self, "left out the picture at %" GST_TIME_FORMAT,
                     GST_TIME_ARGS(picture.start));
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  GstBuffer* acquired = nullptr;
  GstFlowReturn result = acquire_buffer(self, &acquired);
  if (result != GST_FLOW_OK) return result;
  OwnedBuffer buffer(acquired);
  result = draw(self, events, acquired);
  if (result != GST_FLOW_OK) return result;
  GST_BUFFER_PTS(acquired) = picture.start;
  GST_BUFFER_DTS(acquired) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(acquired) = picture.end - picture.start;
  if (std::exchange(self->priv->discontinuous, false))
    GST_BUFFER_FLAG_SET(acquired, GST_BUFFER_FLAG_DISCONT);
  return gst_aggregator_finish_buffer(aggregator, buffer.release());
}

GstFlowReturn push_next_picture(GstEventRender* self) {
  auto& times = *self->priv->times;
  const EventInterval events = times.events();
  const EventInterval picture = times.picture();
  const GstSegment segment = segment_of(self);
  if (GST_CLOCK_TIME_IS_VALID(segment.stop) && picture.start >= segment.stop) return GST_FLOW_EOS;
  times.next();
  return push_picture(self, events, picture);
}

bool has_begun_picture(GstEventRender* self) {
  const auto& priv = *self->priv;
  return priv.state && priv.state->video && priv.times &&
         priv.known > priv.times->events().start + event_resolution;
}

void drain(GstEventRender* self) {
  if (!has_begun_picture(self)) return;
  try {
    push_next_picture(self);
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
  }
}

}  // namespace eventrender
