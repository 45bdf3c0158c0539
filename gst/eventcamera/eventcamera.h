/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:eventcamera
 * @title: GstEventCamera
 * @short_description: event streams of event cameras
 *
 * Event streams are buffers with the caps `application/x-event-camera`:
 *
 * - `format`: `XYTP`, an array of #GstEventCameraEvent;
 * - `width`, `height`: of the sensor, in pixels; every x < width, every y < height;
 * - `framerate`: buffers per second, 0/1 if variable.
 *
 * A buffer holds the events of an interval, which starts at its PTS and has its duration: an array
 * sorted by time, with 0 <= t <= duration, in microseconds rounded down. The time of an event is
 * floor(PTS / 1000) + t microseconds, and no element changes it. Intervals never overlap. An
 * interval without events is a GAP event.
 *
 * In simulated streams, events of the same time are in raster order, and no pixel fires twice in a
 * microsecond. Readers of recordings keep every event of the file; events of the same time stay in
 * the order of the file, and a pixel may have several, of one or both polarities.
 */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#ifndef GST_EVENT_CAMERA_API
#define GST_EVENT_CAMERA_API __attribute__((visibility("default")))
#endif

/**
 * GST_EVENT_CAMERA_MEDIA_TYPE:
 *
 * The media type of event streams.
 *
 * Since: 0.1
 */
#define GST_EVENT_CAMERA_MEDIA_TYPE "application/x-event-camera"

/**
 * GST_EVENT_CAMERA_MAX_SIDE:
 *
 * The maximum width and height of a sensor, in pixels.
 *
 * Since: 0.1
 */
#define GST_EVENT_CAMERA_MAX_SIDE 16384

typedef struct _GstEventCameraEvent GstEventCameraEvent;
typedef struct _GstEventCameraInfo GstEventCameraInfo;
typedef struct _GstEventCameraMap GstEventCameraMap;

/**
 * GstEventCameraEvent:
 * @t: microseconds after the buffer's PTS, rounded down
 * @x: column, from the left
 * @y_p: row from the top in bits 0 to 14; bit 15 is the polarity: 1 = ON (brighter), 0 = OFF
 *
 * One event of a buffer of format XYTP: 8 bytes, little-endian.
 *
 * Since: 0.1
 */
struct _GstEventCameraEvent {
  guint32 t;
  guint16 x;
  guint16 y_p;
};

/**
 * gst_event_camera_event_get_y:
 * @event: an event
 *
 * Returns: the row, from the top
 *
 * Since: 0.1
 */
static inline guint gst_event_camera_event_get_y(const GstEventCameraEvent* event) {
  return event->y_p & 0x7fffu;
}

/**
 * gst_event_camera_event_is_on:
 * @event: an event
 *
 * Returns: %TRUE for ON (brighter), %FALSE for OFF (darker)
 *
 * Since: 0.1
 */
static inline gboolean gst_event_camera_event_is_on(const GstEventCameraEvent* event) {
  return (event->y_p & 0x8000u) != 0;
}

#define GST_TYPE_EVENT_CAMERA_INFO (gst_event_camera_info_get_type())
GST_EVENT_CAMERA_API
GType gst_event_camera_info_get_type(void);

/**
 * GstEventCameraInfo:
 * @width: of the sensor, in pixels
 * @height: of the sensor, in pixels
 * @fps_n: numerator of the buffers per second; 0 if variable
 * @fps_d: denominator of the buffers per second
 *
 * Parsed caps of an event stream of format XYTP.
 *
 * Since: 0.1
 */
struct _GstEventCameraInfo {
  gint width;
  gint height;
  gint fps_n;
  gint fps_d;

  /*< private >*/
  gpointer _gst_reserved[GST_PADDING];
};

/**
 * gst_event_camera_info_from_caps:
 * @info: (out caller-allocates): the result
 * @caps: fixed caps
 *
 * Parses the caps of an event stream of format XYTP. A missing framerate counts as 0/1.
 *
 * Returns: %FALSE if @caps are anything else; @info is then unchanged
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
gboolean gst_event_camera_info_from_caps(GstEventCameraInfo* info, const GstCaps* caps);

/**
 * gst_event_camera_info_to_caps:
 * @info: sensor size and framerate
 *
 * Returns: (transfer full): the caps of an event stream of format XYTP
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstCaps* gst_event_camera_info_to_caps(const GstEventCameraInfo* info);

/**
 * GstEventCameraMap:
 * @events: (array length=n_events): the events of the buffer, sorted by time
 * @n_events: the number of events
 * @start: the time at which t is 0, in microseconds: floor(PTS / 1000)
 *
 * The events of a mapped buffer.
 *
 * Since: 0.1
 */
struct _GstEventCameraMap {
  const GstEventCameraEvent* events;
  gsize n_events;
  guint64 start;

  /*< private >*/
  GstBuffer* buffer;
  GstMapInfo map;
  gpointer _gst_reserved[GST_PADDING];
};

/**
 * gst_event_camera_map:
 * @map: (out caller-allocates): the mapped events; release with gst_event_camera_unmap()
 * @buffer: a buffer of an event stream of format XYTP, with a PTS
 *
 * Maps a buffer to read its events. Nothing is copied if the buffer is a single memory at
 * an address that is a multiple of 4. Events are not validated: check x and y against the caps
 * before you use them as indices.
 *
 * Returns: %FALSE if @buffer cannot be mapped, has no PTS, or ends in a partial event;
 *     @map must then not be unmapped
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
gboolean gst_event_camera_map(GstEventCameraMap* map, GstBuffer* buffer);

/**
 * gst_event_camera_unmap:
 * @map: a map filled in by gst_event_camera_map()
 *
 * Releases the buffer. The events must not be accessed afterwards.
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
void gst_event_camera_unmap(GstEventCameraMap* map);

G_END_DECLS
