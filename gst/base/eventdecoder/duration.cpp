// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/duration.hpp"

#include <mutex>
#include <utility>

#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/pulling.hpp"

namespace eventdecoder {

void set_duration(GstEventDecoder* self, GstClockTime duration) {
  {
    const std::lock_guard lock(self->priv->mutex);
    if (std::exchange(self->priv->duration, duration) == duration) return;
  }
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_duration_changed(GST_OBJECT(self)));
}

GstClockTime duration_so_far(GstEventDecoder* self) {
  const Chunker& chunker = self->priv->state->chunker;
  const std::lock_guard lock(self->priv->mutex);
  if (!self->priv->first || chunker.latest() < *self->priv->first) return self->priv->duration;
  return static_cast<GstClockTime>(chunker.latest() + 1 - *self->priv->first) * GST_USECOND;
}

/// Bytes that are pushed tell only by and by how long it all is.
static GstClockTime estimated_duration(GstEventDecoder* self) {
  const guint64 size = upstream_bytes(self->priv->sink);
  if (size == 0) return GST_CLOCK_TIME_NONE;
  const std::lock_guard lock(self->priv->mutex);
  if (self->priv->pushed_bytes == 0 || self->priv->segment.position == 0)
    return GST_CLOCK_TIME_NONE;
  return gst_util_uint64_scale(self->priv->segment.position, size, self->priv->pushed_bytes);
}

GstClockTime duration_of(GstEventDecoder* self) {
  {
    const std::lock_guard lock(self->priv->mutex);
    if (GST_CLOCK_TIME_IS_VALID(self->priv->duration) || self->priv->pulls)
      return self->priv->duration;
  }
  return estimated_duration(self);
}

}  // namespace eventdecoder
