// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/statistics.hpp"

#include <mutex>

#include "gst/base/eventdecoder/state.hpp"

namespace eventdecoder {

GstStructure* make_stats(GstEventDecoder* self) {
  const std::lock_guard lock(self->priv->mutex);
  const Counts& counts = self->priv->counts;
  return gst_structure_new("application/x-event-decoder-stats", "events", G_TYPE_UINT64,
                           counts.events, "triggers", G_TYPE_UINT64, counts.triggers,
                           "corrupt-places", G_TYPE_UINT64, counts.corrupt_places, "outside",
                           G_TYPE_UINT64, counts.outside, "late", G_TYPE_UINT64,
                           counts.dropped.late, "stray", G_TYPE_UINT64, counts.dropped.stray,
                           "repeated", G_TYPE_UINT64, counts.dropped.repeated, nullptr);
}

static void count(GstEventDecoder* self) {
  const State& state = *self->priv->state;
  const Corruption& corruption = state.corruption();
  const std::lock_guard lock(self->priv->mutex);
  Counts& counts = self->priv->counts;
  counts.corrupt_places = corruption.places - state.before.places;
  counts.outside = corruption.outside - state.before.outside + state.outside;
  counts.dropped = state.chunker.dropped();
}

void report(GstEventDecoder* self) {
  count(self);
  const Corruption& corruption = self->priv->state->corruption();
  if (corruption.places > 0)
    self->priv->faults.warn_of_corruption(corruption.first_at, corruption.first.c_str());
}

void warn_of_dropped(GstEventDecoder* self) {
  Counts counts;
  {
    const std::lock_guard lock(self->priv->mutex);
    counts = self->priv->counts;
  }
  GST_INFO_OBJECT(self,
                  "%" G_GUINT64_FORMAT " corrupt places, %" G_GUINT64_FORMAT
                  " triggers, %" G_GUINT64_FORMAT " events repeated",
                  counts.corrupt_places, counts.triggers, counts.dropped.repeated);
  const guint64 times = counts.dropped.late + counts.dropped.stray;
  if (times + counts.outside == 0) return;
  GST_ELEMENT_WARNING(self, STREAM, DECODE,
                      ("%" G_GUINT64_FORMAT " events outside the sensor and %" G_GUINT64_FORMAT
                       " with times out of order were left out.",
                       counts.outside, times),
                      (nullptr));
}

}  // namespace eventdecoder
