/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "crop.h"

#include <gst/eventcamera/eventcamera.h>
#include <stdio.h>

gboolean region_from_text(Region* region, const char* text) {
  /* Alone, sscanf() would take signs and spaces. */
  static const char form[] = "^[0-9]{1,5}x[0-9]{1,5}[+][0-9]{1,5}[+][0-9]{1,5}\\z";
  return g_regex_match_simple(form, text, 0, 0) &&
         sscanf(text, "%5ux%5u+%5u+%5u", &region->width, &region->height, &region->x, &region->y) ==
             4 &&
         region->width > 0 && region->height > 0 &&
         region->x + region->width <= GST_EVENT_CAMERA_MAX_SIDE &&
         region->y + region->height <= GST_EVENT_CAMERA_MAX_SIDE;
}

/* Events of `in` within the region, or NULL if there are none. */
static GstBuffer* cropped_buffer(const Region* region, GstBuffer* in) {
  GstBuffer* out = gst_buffer_new_allocate(NULL, gst_buffer_get_size(in), NULL);
  GstEventCameraMap events;
  GstMapInfo bytes;
  gsize count = 0;
  if (gst_event_camera_map(&events, in)) {
    gst_buffer_map(out, &bytes, GST_MAP_WRITE);
    for (gsize i = 0; i < events.n_events; ++i) {
      GstEventCameraEvent event = events.events[i];
      /* Unsigned: a pixel before the region wraps past its end. */
      if (event.x - region->x >= region->width ||
          gst_event_camera_event_get_y(&event) - region->y >= region->height)
        continue;
      event.x = (guint16)(event.x - region->x);
      event.y_p = (guint16)(event.y_p - region->y); /* does not change the polarity */
      ((GstEventCameraEvent*)bytes.data)[count++] = event;
    }
    gst_buffer_unmap(out, &bytes);
    gst_event_camera_unmap(&events);
  }
  gst_buffer_copy_into(out, in, GST_BUFFER_COPY_METADATA, 0, (gsize)-1);
  gst_buffer_set_size(out, (gssize)(count * sizeof(GstEventCameraEvent)));
  if (count == 0) gst_clear_buffer(&out);
  return out;
}

/* Caps of the region, or NULL if it is not within the sensor. */
static GstCaps* cropped_caps(const Region* region, const GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps) ||
      region->x + region->width > (guint)info.width ||
      region->y + region->height > (guint)info.height)
    return NULL;
  info.width = (gint)region->width;
  info.height = (gint)region->height;
  return gst_event_camera_info_to_caps(&info);
}

static GstPadProbeReturn crop_buffer(GstPad* pad, GstPadProbeInfo* info, const Region* region) {
  GstBuffer* in = GST_PAD_PROBE_INFO_BUFFER(info);
  GstBuffer* out = cropped_buffer(region, in);
  if (out != NULL) {
    info->data = out;
    gst_buffer_unref(in);
    return GST_PAD_PROBE_OK;
  }
  gst_pad_push_event(pad, gst_event_new_gap(GST_BUFFER_PTS(in), GST_BUFFER_DURATION(in)));
  return GST_PAD_PROBE_DROP;
}

static GstPadProbeReturn crop_caps(GstPad* pad, GstPadProbeInfo* info, const Region* region) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  GstCaps* caps;
  GstCaps* cropped;
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return GST_PAD_PROBE_OK;
  gst_event_parse_caps(event, &caps);
  cropped = cropped_caps(region, caps);
  if (cropped == NULL) {
    GstElement* element = gst_pad_get_parent_element(pad);
    GST_ELEMENT_ERROR(element, STREAM, FORMAT,
                      ("The region %ux%u+%u+%u is not within the sensor.", region->width,
                       region->height, region->x, region->y),
                      ("%" GST_PTR_FORMAT, (void*)caps));
    gst_object_unref(element);
    return GST_PAD_PROBE_DROP;
  }
  info->data = gst_event_new_caps(cropped);
  gst_caps_unref(cropped);
  gst_event_unref(event);
  return GST_PAD_PROBE_OK;
}

static GstPadProbeReturn crop(GstPad* pad, GstPadProbeInfo* info, gpointer region) {
  return (info->type & GST_PAD_PROBE_TYPE_BUFFER) != 0 ? crop_buffer(pad, info, region)
                                                       : crop_caps(pad, info, region);
}

void crop_events(GstPad* pad, const Region* region) {
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, crop,
                    (gpointer)region, NULL);
}
