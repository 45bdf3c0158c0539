// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/statistics.hpp"

#include <mutex>

namespace aedatdemux {

GstStructure* make_stats(GstAedatDemux* self) {
  const std::lock_guard lock(self->priv->mutex);
  const Counts& counts = self->priv->counts;
  return gst_structure_new(
      "application/x-aedat-demux-stats", "events", G_TYPE_UINT64, counts.events, "frames",
      G_TYPE_UINT64, counts.frames, "triggers", G_TYPE_UINT64, counts.triggers, "imu-samples",
      G_TYPE_UINT64, counts.imu_samples, "corrupt-places", G_TYPE_UINT64, counts.corrupt_places,
      "outside", G_TYPE_UINT64, counts.outside, "untimely", G_TYPE_UINT64, counts.untimely,
      "repeated", G_TYPE_UINT64, counts.repeated, nullptr);
}

static void count(GstAedatDemux* self) {
  const State& state = self->priv->state;
  Counts counts = state.counts;
  const auto& corruption = state.reader.corruption();
  counts.corrupt_places += corruption.places;
  counts.outside += corruption.outside;
  if (const auto* const aedat4 = state.reader.aedat4())
    counts.imu_samples = aedat4->skipped().imu_samples;
  for (const auto& stream : state.streams) {
    if (state.holding) break;
    const auto& dropped = stream.chunker.dropped();
    counts.untimely += dropped.late + dropped.stray;
    counts.repeated += dropped.repeated;
  }
  const std::lock_guard lock(self->priv->mutex);
  self->priv->counts = counts;
}

void report(GstAedatDemux* self) {
  count(self);
  const auto& corruption = self->priv->state.reader.corruption();
  if (corruption.places > 0)
    self->priv->faults.warn_of_corruption(corruption.first_at, corruption.first.c_str());
}

void tell_counts(GstAedatDemux* self) {
  GstStructure* stats = make_stats(self);
  GST_INFO_OBJECT(self, "%" GST_PTR_FORMAT, stats);
  gst_structure_free(stats);
  const Counts& counts = self->priv->counts;
  if (counts.outside + counts.untimely == 0) return;
  GST_ELEMENT_WARNING(self, STREAM, DEMUX,
                      ("%" G_GUINT64_FORMAT " events outside the sensor, and %" G_GUINT64_FORMAT
                       " events and frames with times out of order, were left out.",
                       counts.outside, counts.untimely),
                      (nullptr));
}

}  // namespace aedatdemux
