// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/file_streams.hpp"

#include "gst/eventcamera/eventcamera.h"

GstCaps* file_events_caps(eventcamera::SensorSize size) {
  GstEventCameraInfo info = {};
  info.width = size.width;
  info.height = size.height;
  info.fps_d = 1;
  return gst_event_camera_info_to_caps(&info);
}

guint group_of_streams(GstEvent* upstream) {
  guint group = GST_GROUP_ID_INVALID;
  if (upstream != nullptr && gst_event_parse_group_id(upstream, &group)) return group;
  return gst_util_group_id_next();
}

GstEvent* file_stream_start(GstElement* element, GstPad* pad, const char* name, guint group) {
  gchar* const id = gst_pad_create_stream_id(pad, element, name);
  GstStream* const stream =
      gst_stream_new(id, nullptr, GST_STREAM_TYPE_VIDEO, GST_STREAM_FLAG_NONE);
  GstEvent* const event = gst_event_new_stream_start(id);
  gst_event_set_stream(event, stream);
  gst_event_set_group_id(event, group);
  gst_object_unref(stream);
  g_free(id);
  return event;
}

gboolean push_stream_caps(GstPad* pad, GstCaps* caps) {
  if (GstStream* const stream = gst_pad_get_stream(pad)) {
    gst_stream_set_caps(stream, caps);
    gst_object_unref(stream);
  }
  return gst_pad_push_event(pad, gst_event_new_caps(caps));
}

void announce_streams(GstElement* element, std::span<GstPad* const> pads) {
  GstStreamCollection* const collection = gst_stream_collection_new(nullptr);
  for (GstPad* const pad : pads)
    if (GstStream* const stream = gst_pad_get_stream(pad))
      gst_stream_collection_add_stream(collection, stream);
  gst_element_post_message(element,
                           gst_message_new_stream_collection(GST_OBJECT(element), collection));
  for (GstPad* const pad : pads)
    gst_pad_push_event(pad, gst_event_new_stream_collection(collection));
  gst_object_unref(collection);
}

GstSegment segment_from(GstClockTime first, GstSegment segment) {
  segment.start += first;
  segment.position += first;
  if (GST_CLOCK_TIME_IS_VALID(segment.stop)) segment.stop += first;
  return segment;
}

GstEvent* end_of_streams(GstElement* element, const GstSegment& segment, guint32 seqnum) {
  if ((segment.flags & GST_SEGMENT_FLAG_SEGMENT) == 0)
    return with_seqnum(gst_event_new_eos(), seqnum);
  const auto position =
      static_cast<gint64>(GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : segment.position);
  GstMessage* const message =
      gst_message_new_segment_done(GST_OBJECT(element), GST_FORMAT_TIME, position);
  if (seqnum != GST_SEQNUM_INVALID) gst_message_set_seqnum(message, seqnum);
  gst_element_post_message(element, message);
  return with_seqnum(gst_event_new_segment_done(GST_FORMAT_TIME, position), seqnum);
}

GstEvent* with_seqnum(GstEvent* event, guint32 seqnum) {
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(event, seqnum);
  return event;
}
