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
 *
 * Buffers may carry a #GstEventCameraLabelMeta: a #GstEventCameraLabel for each of their events.
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
typedef struct _GstEventCameraLabel GstEventCameraLabel;
typedef struct _GstEventCameraLabelMeta GstEventCameraLabelMeta;

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
 * @info: sensor size and framerate; a framerate whose denominator is 0 counts as 0/1
 *
 * Returns: (transfer full): the caps of an event stream of format XYTP
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstCaps* gst_event_camera_info_to_caps(const GstEventCameraInfo* info);

/**
 * GstEventCameraMap:
 * @n_events: the number of events
 * @start: the time at which t is 0, in microseconds: floor(PTS / 1000)
 *
 * The events of a mapped buffer. In C, `events` is the array of its #GstEventCameraEvent, sorted by
 * time; other languages call gst_event_camera_unpack() or gst_buffer_extract_dup().
 *
 * Since: 0.1
 */
struct _GstEventCameraMap {
  /*< private >*/ /* an array, which only C can index */
  const GstEventCameraEvent* events;

  /*< public >*/
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

/**
 * GstEventCameraCause:
 * @GST_EVENT_CAMERA_CAUSE_UNKNOWN: not known
 * @GST_EVENT_CAMERA_CAUSE_LIGHT: a change of light
 * @GST_EVENT_CAMERA_CAUSE_LEAK: the leak of the pixel's reference level
 * @GST_EVENT_CAMERA_CAUSE_SHOT_NOISE: shot noise
 * @GST_EVENT_CAMERA_CAUSE_HOT_PIXEL: the leak of a hot pixel
 * @GST_EVENT_CAMERA_CAUSE_EXPOSURE_PULSE: the start or end of a frame's exposure, in cameras that
 *     also capture frames
 *
 * Why a simulated pixel fired. Later versions may add causes.
 *
 * Since: 0.1
 */
typedef enum {
  GST_EVENT_CAMERA_CAUSE_UNKNOWN = 0,
  GST_EVENT_CAMERA_CAUSE_LIGHT = 1,
  GST_EVENT_CAMERA_CAUSE_LEAK = 2,
  GST_EVENT_CAMERA_CAUSE_SHOT_NOISE = 3,
  GST_EVENT_CAMERA_CAUSE_HOT_PIXEL = 4,
  GST_EVENT_CAMERA_CAUSE_EXPOSURE_PULSE = 5
} GstEventCameraCause;

/**
 * GstEventCameraLabel:
 * @object_class: class of the object that the pixel saw, in the numbering of the application; 0 if
 *     unknown
 * @cause: a #GstEventCameraCause
 * @reserved: 0; readers ignore it
 *
 * Label of one event: 4 bytes, little-endian. Byte 0 and 1 are @object_class, byte 2 is @cause,
 * byte 3 is @reserved.
 *
 * Since: 0.1
 */
struct _GstEventCameraLabel {
  guint16 object_class;
  guint8 cause;
  guint8 reserved;
};

/**
 * GstEventCameraLabelMeta:
 * @meta: parent #GstMeta
 * @n_labels: the number of labels
 *
 * Labels of the events of a buffer of format XYTP, in the order of the events. They are valid if
 * there is one for each event, and are otherwise ignored. In C, `labels` is their array; other
 * languages call gst_event_camera_label_meta_get_bytes().
 *
 * A copy of a buffer has a copy of its labels, and a copy of a part has the labels of the events in
 * it. Elements that drop or reorder events do the same to the labels. The API has the tag `events`:
 * elements that turn events into anything else drop it.
 *
 * Since: 0.1
 */
struct _GstEventCameraLabelMeta {
  GstMeta meta;

  /*< private >*/ /* an array, which only C can index */
  GstEventCameraLabel* labels;

  /*< public >*/
  gsize n_labels;
};

#define GST_EVENT_CAMERA_LABEL_META_API_TYPE (gst_event_camera_label_meta_api_get_type())

/**
 * gst_event_camera_label_meta_api_get_type:
 *
 * Returns: the type of the API of #GstEventCameraLabelMeta
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GType gst_event_camera_label_meta_api_get_type(void);

#define GST_EVENT_CAMERA_LABEL_META_INFO (gst_event_camera_label_meta_get_info())

/**
 * gst_event_camera_label_meta_get_info:
 *
 * Returns: (transfer none): the description of #GstEventCameraLabelMeta for gst_buffer_add_meta()
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
const GstMetaInfo* gst_event_camera_label_meta_get_info(void);

/**
 * gst_buffer_add_event_camera_label_meta:
 * @buffer: a writable buffer of an event stream of format XYTP, without labels
 * @labels: (nullable) (array length=n_labels): labels to copy; %NULL for zeros
 * @n_labels: the number of events in the buffer
 *
 * Adds labels to a buffer. They may be written in place.
 *
 * Returns: (transfer none) (nullable): the labels, which belong to @buffer; %NULL if there is not
 *     enough memory
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEventCameraLabelMeta* gst_buffer_add_event_camera_label_meta(GstBuffer* buffer,
                                                                const GstEventCameraLabel* labels,
                                                                gsize n_labels);

/**
 * gst_buffer_add_event_camera_label_bytes:
 * @buffer: a writable buffer of an event stream of format XYTP, without labels
 * @bytes: a label for each event in the buffer, 4 bytes each, in the layout of #GstEventCameraLabel
 *
 * Adds labels to a buffer, for languages that write structures as bytes, such as those of
 * gst_event_camera_label_meta_get_bytes().
 *
 * Returns: (transfer none) (nullable): the labels, which belong to @buffer; %NULL if there is not
 *     enough memory
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEventCameraLabelMeta* gst_buffer_add_event_camera_label_bytes(GstBuffer* buffer, GBytes* bytes);

/**
 * gst_buffer_get_event_camera_label_meta:
 * @buffer: a buffer of an event stream of format XYTP
 *
 * Returns: (transfer none) (nullable): the labels of its events, which belong to @buffer; %NULL if
 *     it has none, or not one for each event
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEventCameraLabelMeta* gst_buffer_get_event_camera_label_meta(GstBuffer* buffer);

/**
 * gst_event_camera_label_meta_truncate:
 * @meta: labels of a writable buffer
 * @n_labels: the new number of labels, at most the present one
 *
 * Drops the last labels, after gst_buffer_set_size() has cut events from the end of the buffer.
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
void gst_event_camera_label_meta_truncate(GstEventCameraLabelMeta* meta, gsize n_labels);

/**
 * gst_event_camera_label_meta_get_bytes:
 * @meta: labels
 *
 * Copies the labels for languages that read structures from bytes, 4 bytes each, in the layout of
 * #GstEventCameraLabel.
 *
 * Returns: (transfer full): the labels
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GBytes* gst_event_camera_label_meta_get_bytes(const GstEventCameraLabelMeta* meta);

/**
 * GstEventCameraFlowMeta:
 * @meta: parent #GstMeta
 * @width: of the frame, in pixels
 * @height: of the frame, in pixels
 *
 * Optical flow of a video frame: the motion of each of its pixels until the next frame. The
 * simulators use it instead of estimating the motion.
 *
 * A copy of a frame shares its flow; a copy of a part has none. Elements that scale or crop frames
 * drop it, elements that convert their format keep it. Flip frames, and change their framerate,
 * before flow is added: GStreamer's `videoflip` and `videorate` keep it unchanged.
 *
 * Since: 0.1
 */
typedef struct _GstEventCameraFlowMeta {
  GstMeta meta;

  guint width;
  guint height;

  /*< private >*/
  GBytes* flow;
} GstEventCameraFlowMeta;

#define GST_EVENT_CAMERA_FLOW_META_API_TYPE (gst_event_camera_flow_meta_api_get_type())

/**
 * gst_event_camera_flow_meta_api_get_type:
 *
 * Returns: the type of the API of #GstEventCameraFlowMeta
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GType gst_event_camera_flow_meta_api_get_type(void);

#define GST_EVENT_CAMERA_FLOW_META_INFO (gst_event_camera_flow_meta_get_info())

/**
 * gst_event_camera_flow_meta_get_info:
 *
 * Returns: (transfer none): the description of #GstEventCameraFlowMeta for gst_buffer_add_meta()
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
const GstMetaInfo* gst_event_camera_flow_meta_get_info(void);

/**
 * gst_buffer_add_event_camera_flow_meta:
 * @buffer: a writable video frame
 * @width: of the frame, in pixels
 * @height: of the frame, in pixels
 * @flow: two 32-bit floating-point numbers per pixel, row by row: the motion to the right and down
 *     until the next frame, in pixels
 *
 * Adds optical flow to a video frame, in place of the flow that it had. Nothing is copied.
 *
 * Returns: (transfer none) (nullable): the flow, which belongs to @buffer; %NULL unless @flow has
 *     @width x @height x 8 bytes and both sides are from 1 to %GST_EVENT_CAMERA_MAX_SIDE
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEventCameraFlowMeta* gst_buffer_add_event_camera_flow_meta(GstBuffer* buffer, guint width,
                                                              guint height, GBytes* flow);

/**
 * gst_buffer_get_event_camera_flow_meta:
 * @buffer: a video frame
 *
 * Returns: (transfer none) (nullable): the optical flow of the frame, which belongs to @buffer;
 *     %NULL if it has none
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEventCameraFlowMeta* gst_buffer_get_event_camera_flow_meta(GstBuffer* buffer);

/**
 * gst_event_camera_flow_meta_get_flow:
 * @meta: optical flow
 *
 * Returns: (transfer none): @width x @height x 2 32-bit floating-point numbers, in the layout of
 *     gst_buffer_add_event_camera_flow_meta(), at an address that is a multiple of 4
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GBytes* gst_event_camera_flow_meta_get_flow(const GstEventCameraFlowMeta* meta);

typedef struct _GstEventCameraAbsoluteEvent GstEventCameraAbsoluteEvent;

/**
 * GstEventCameraAbsoluteEvent:
 * @t: microseconds, of the whole stream: floor(PTS / 1000) + t of the event
 * @x: column, from the left
 * @y: row, from the top
 * @p: the polarity: 1 = ON (brighter), 0 = OFF
 *
 * One event in an array that does not belong to a buffer: 16 bytes, the last 3 of which are not
 * used.
 *
 * Since: 0.1
 */
struct _GstEventCameraAbsoluteEvent {
  gint64 t;
  guint16 x;
  guint16 y;
  guint8 p;

  /*< private >*/
  guint8 _gst_reserved[3];
};

/**
 * GstEventCameraTrigger:
 * @t: microseconds, of the whole stream, as for #GstEventCameraAbsoluteEvent
 * @input: the camera's input
 * @is_rising: 1 for a rising edge, 0 for a falling one
 *
 * An edge on a trigger input of a camera: 16 bytes, little-endian.
 *
 * Since: 0.1
 */
typedef struct _GstEventCameraTrigger {
  gint64 t;
  guint32 input;
  guint32 is_rising;
} GstEventCameraTrigger;

/**
 * GstEventCameraImuSample:
 * @t: microseconds, of the whole stream, as for #GstEventCameraAbsoluteEvent
 * @temperature: in degrees Celsius
 * @acceleration: along x, y and z, in g
 * @rotation: around x, y and z, in degrees per second
 * @magnetic_field: along x, y and z, in microtesla
 *
 * A sample of a camera's inertial measurement unit: 48 bytes, little-endian.
 *
 * Since: 0.1
 */
typedef struct _GstEventCameraImuSample {
  gint64 t;
  gfloat temperature;
  gfloat acceleration[3];
  gfloat rotation[3];
  gfloat magnetic_field[3];
} GstEventCameraImuSample;

/**
 * gst_event_new_event_camera_triggers:
 * @triggers: an array of #GstEventCameraTrigger, sorted by time; may be empty
 *
 * Creates a serialized event that carries triggers with a stream of events. Readers send it before
 * the buffer or GAP event of the interval; an empty one before the first buffer announces that
 * triggers may follow. Writers store the triggers if their format has any, other elements forward
 * them.
 *
 * Returns: (transfer full) (nullable): the event; %NULL if @triggers ends in a partial one
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEvent* gst_event_new_event_camera_triggers(GBytes* triggers);

/**
 * gst_event_get_event_camera_triggers:
 * @event: any event
 *
 * Returns: (transfer full) (nullable): the array of #GstEventCameraTrigger that the event carries,
 *     at an address that is a multiple of 8; %NULL if it is an event of another kind
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GBytes* gst_event_get_event_camera_triggers(GstEvent* event);

/**
 * gst_event_new_event_camera_imu_samples:
 * @samples: an array of #GstEventCameraImuSample, sorted by time; may be empty
 *
 * Creates a serialized event that carries IMU samples with a stream of events, in the same way as
 * gst_event_new_event_camera_triggers().
 *
 * Returns: (transfer full) (nullable): the event; %NULL if @samples ends in a partial one
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GstEvent* gst_event_new_event_camera_imu_samples(GBytes* samples);

/**
 * gst_event_get_event_camera_imu_samples:
 * @event: any event
 *
 * Returns: (transfer full) (nullable): the array of #GstEventCameraImuSample that the event
 * carries, at an address that is a multiple of 8; %NULL if it is an event of another kind
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GBytes* gst_event_get_event_camera_imu_samples(GstEvent* event);

/**
 * gst_event_camera_unpack:
 * @buffer: a buffer of an event stream of format XYTP, with a PTS
 *
 * Copies the events of a buffer for languages that read structures from bytes.
 *
 * Returns: (transfer full) (nullable): 16 bytes per event, in the layout of
 *     #GstEventCameraAbsoluteEvent; %NULL if @buffer cannot be mapped, has no PTS, or ends in a
 *     partial event, or if there is not enough memory
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
GBytes* gst_event_camera_unpack(GstBuffer* buffer);

/**
 * GST_EVENT_CAMERA_MAX_BINS:
 *
 * The maximum number of bins of a voxel grid.
 *
 * Since: 0.1
 */
#define GST_EVENT_CAMERA_MAX_BINS 256

/**
 * gst_event_camera_voxel_grid: (skip)
 * @events: (array length=n_events): events sorted by time
 * @n_events: the number of events
 * @width: of the sensor, in pixels
 * @height: of the sensor, in pixels
 * @bins: number of instants, at most %GST_EVENT_CAMERA_MAX_BINS
 * @grid: memory for @bins x @height x @width numbers
 *
 * Writes the voxel grid of events, the same as the element `eventtensor` makes of a window: each
 * event adds its polarity, +1 or -1, to the two nearest of @bins instants, in proportion to their
 * closeness. The first instant is the time of the first event, the last instant the time of the
 * last event.
 *
 * Returns: %FALSE if an event is outside the sensor or earlier than the one before it; @grid is
 * then unspecified
 *
 * Since: 0.1
 */
GST_EVENT_CAMERA_API
gboolean gst_event_camera_voxel_grid(const GstEventCameraAbsoluteEvent* events, gsize n_events,
                                     guint width, guint height, guint bins, gfloat* grid);

G_END_DECLS
