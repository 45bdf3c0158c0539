// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aggregator_pads.hpp"

#include "gst/base/owned.hpp"

GstAggregatorPad* add_sink_pad(gpointer aggregator, const char* name) {
  GstPadTemplate* pad_template =
      gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(aggregator), name);
  auto* pad = GST_PAD(g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", name, "direction", GST_PAD_SINK,
                                   "template", pad_template, nullptr));
  gst_element_add_pad(GST_ELEMENT(aggregator), pad);
  return GST_AGGREGATOR_PAD(pad);
}

void answer_caps_of_passed(GstAggregator* aggregator, GstAggregatorPad* pad, GstQuery* query) {
  GstCaps* filter = nullptr;
  gst_query_parse_caps(query, &filter);
  const OwnedCaps ours(gst_pad_get_pad_template_caps(GST_PAD(pad)));
  const OwnedCaps taken(gst_pad_peer_query_caps(GST_AGGREGATOR_SRC_PAD(aggregator), filter));
  const OwnedCaps result(
      gst_caps_intersect_full(taken.get(), ours.get(), GST_CAPS_INTERSECT_FIRST));
  gst_query_set_caps_result(query, result.get());
}

bool plays_forwards(gpointer aggregator, const GstSegment& segment, const char* taken) {
  if (segment.format == GST_FORMAT_TIME && segment.rate >= 0) return true;
  GST_ELEMENT_ERROR(aggregator, STREAM, FAILED, ("Events can be %s forwards in time only.", taken),
                    ("The segment is %" GST_SEGMENT_FORMAT, &segment));
  return false;
}
