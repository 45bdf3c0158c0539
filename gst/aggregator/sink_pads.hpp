// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <memory>
#include <vector>

#include "gst/base/pads.hpp"

/// Ends of segments on sink pads. gst_aggregator_default_sink_event() has no case for SEGMENT_DONE:
/// it forwards the event from each pad, and gst_aggregator_check_pads_ready() then waits for a
/// buffer of a pad that has ended. A GAP event, for which GstAggregator queues an empty buffer in
/// order, replaces SEGMENT_DONE and carries it. That buffer stays queued until all pads have ended.

inline GQuark segment_end_quark() {
  static const GQuark quark = g_quark_from_static_string("event-segment-end");
  return quark;
}

inline void unref_event(gpointer event) {
  gst_event_unref(GST_EVENT(event));
}

/// Returns a GAP event that owns a SEGMENT_DONE event, or the event itself if the segment is not in
/// time format.
inline GstEvent* gap_at_segment_end(GstAggregatorPad* pad, GstEvent* done) {
  const OwnedEvent sticky(gst_pad_get_sticky_event(GST_PAD(pad), GST_EVENT_SEGMENT, 0));
  if (!sticky) return done;
  const GstSegment& segment = segment_of(sticky.get());
  if (segment.format != GST_FORMAT_TIME) return done;
  GstEvent* const gap = gst_event_new_gap(segment.start, GST_CLOCK_TIME_NONE);
  gst_mini_object_set_qdata(GST_MINI_OBJECT(gap), segment_end_quark(), done, unref_event);
  return gap;
}

/// Stores the SEGMENT_DONE event that a GAP event carries, if any, with the pad.
inline void store_segment_end(GstAggregatorPad* pad, GstEvent* gap) {
  gpointer const done = gst_mini_object_get_qdata(GST_MINI_OBJECT(gap), segment_end_quark());
  if (done != nullptr)
    g_object_set_qdata_full(G_OBJECT(pad), segment_end_quark(), gst_event_ref(GST_EVENT(done)),
                            unref_event);
}

/// SEGMENT_DONE event that a pad has reached; null if none.
inline OwnedEvent segment_end_of(GstAggregatorPad* pad) {
  const auto ref = [](gpointer event, gpointer) -> gpointer {
    return event != nullptr ? gst_event_ref(GST_EVENT(event)) : nullptr;
  };
  return OwnedEvent(
      static_cast<GstEvent*>(g_object_dup_qdata(G_OBJECT(pad), segment_end_quark(), ref, nullptr)));
}

inline void forget_segment_end(GstAggregatorPad* pad) {
  g_object_set_qdata(G_OBJECT(pad), segment_end_quark(), nullptr);
}

/// True if a pad has reached the end of its stream, or of the segment of a segment seek.
inline bool has_ended(GstAggregatorPad* pad) {
  return segment_end_of(pad) ||
         (gst_aggregator_pad_is_eos(pad) && !gst_aggregator_pad_has_buffer(pad));
}

/// The next queued buffer of a pad; null if there is none, or if the segment has ended.
inline OwnedBuffer next_buffer(GstAggregatorPad* pad) {
  return OwnedBuffer(segment_end_of(pad) ? nullptr : gst_aggregator_pad_peek_buffer(pad));
}

struct UnrefPad {
  void operator()(GstAggregatorPad* pad) const { gst_object_unref(pad); }
};
using OwnedAggregatorPad = std::unique_ptr<GstAggregatorPad, UnrefPad>;

/// The sink pads of an element in the order in which they were added. They may be released
/// meanwhile.
inline std::vector<OwnedAggregatorPad> sink_pads(gpointer element) {
  std::vector<OwnedAggregatorPad> pads;
  GST_OBJECT_LOCK(element);
  for (const GList* list = GST_ELEMENT(element)->sinkpads; list != nullptr; list = list->next)
    pads.emplace_back(GST_AGGREGATOR_PAD(gst_object_ref(list->data)));
  GST_OBJECT_UNLOCK(element);
  return pads;
}

/// Calls `work`, which must not throw, with each sink pad of an element.
template <class Work>
void for_each_sink_pad(gpointer element, Work work) noexcept {
  const auto call = [](GstElement*, GstPad* pad, gpointer to) -> gboolean {
    (*static_cast<Work*>(to))(GST_AGGREGATOR_PAD(pad));
    return TRUE;
  };
  gst_element_foreach_sink_pad(GST_ELEMENT(element), call, &work);
}
