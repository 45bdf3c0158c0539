// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/eventcamera/eventcamera.h"

#include <gst/video/video.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <exception>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/tensor/event_tensor.hpp"

static_assert(sizeof(GstEventCameraEvent) == sizeof(eventcamera::Event) &&
                  offsetof(GstEventCameraEvent, x) == offsetof(eventcamera::Event, x) &&
                  offsetof(GstEventCameraEvent, y_p) == offsetof(eventcamera::Event, y_p),
              "the core's events are passed to applications unchanged");
static_assert(sizeof(GstEventCameraLabel) == sizeof(eventcamera::Label) &&
                  offsetof(GstEventCameraLabel, cause) == offsetof(eventcamera::Label, cause) &&
                  GST_EVENT_CAMERA_CAUSE_EXPOSURE_PULSE ==
                      static_cast<int>(eventcamera::Cause::exposure_pulse),
              "the core's labels are passed to applications unchanged");

static GstEventCameraInfo* gst_event_camera_info_copy(const GstEventCameraInfo* info) {
  return static_cast<GstEventCameraInfo*>(g_memdup2(info, sizeof *info));
}

static void gst_event_camera_info_free(GstEventCameraInfo* info) {
  g_free(info);
}

G_DEFINE_BOXED_TYPE(GstEventCameraInfo, gst_event_camera_info, gst_event_camera_info_copy,
                    gst_event_camera_info_free)

gboolean gst_event_camera_info_from_caps(GstEventCameraInfo* info, const GstCaps* caps) {
  g_return_val_if_fail(info != nullptr, FALSE);
  g_return_val_if_fail(gst_caps_is_fixed(caps), FALSE);

  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  GstEventCameraInfo found = {};
  found.fps_d = 1;
  if (!gst_structure_has_name(structure, GST_EVENT_CAMERA_MEDIA_TYPE) ||
      g_strcmp0(gst_structure_get_string(structure, "format"), "XYTP") != 0 ||
      !gst_structure_get_int(structure, "width", &found.width) ||
      !gst_structure_get_int(structure, "height", &found.height) || found.width < 1 ||
      found.width > GST_EVENT_CAMERA_MAX_SIDE || found.height < 1 ||
      found.height > GST_EVENT_CAMERA_MAX_SIDE)
    return FALSE;
  if (gst_structure_has_field(structure, "framerate") &&
      !gst_structure_get_fraction(structure, "framerate", &found.fps_n, &found.fps_d))
    return FALSE;
  *info = found;
  return TRUE;
}

GstCaps* gst_event_camera_info_to_caps(const GstEventCameraInfo* info) {
  g_return_val_if_fail(info != nullptr, nullptr);
  const bool has_framerate = info->fps_d != 0;
  return gst_caps_new_simple(GST_EVENT_CAMERA_MEDIA_TYPE, "format", G_TYPE_STRING, "XYTP", "width",
                             G_TYPE_INT, info->width, "height", G_TYPE_INT, info->height,
                             "framerate", GST_TYPE_FRACTION, has_framerate ? info->fps_n : 0,
                             has_framerate ? info->fps_d : 1, nullptr);
}

gboolean gst_event_camera_map(GstEventCameraMap* map, GstBuffer* buffer) {
  g_return_val_if_fail(map != nullptr, FALSE);
  g_return_val_if_fail(GST_IS_BUFFER(buffer), FALSE);

  if (!GST_BUFFER_PTS_IS_VALID(buffer) ||
      gst_buffer_get_size(buffer) % sizeof(GstEventCameraEvent) != 0)
    return FALSE;
  *map = {};
  if (!gst_buffer_map(buffer, &map->map, GST_MAP_READ)) return FALSE;
  map->buffer = gst_buffer_ref(buffer);
  if (GPOINTER_TO_SIZE(map->map.data) % alignof(GstEventCameraEvent) != 0) {
    gst_buffer_unmap(map->buffer, &map->map);
    gst_buffer_unref(map->buffer);
    map->buffer = gst_buffer_copy_deep(buffer);
    if (!gst_buffer_map(map->buffer, &map->map, GST_MAP_READ)) {
      gst_clear_buffer(&map->buffer);
      return FALSE;
    }
  }
  map->events = reinterpret_cast<const GstEventCameraEvent*>(map->map.data);
  map->n_events = map->map.size / sizeof(GstEventCameraEvent);
  map->start = GST_BUFFER_PTS(buffer) / GST_USECOND;
  return TRUE;
}

void gst_event_camera_unmap(GstEventCameraMap* map) {
  g_return_if_fail(map != nullptr);
  gst_buffer_unmap(map->buffer, &map->map);
  gst_buffer_unref(map->buffer);
}

GType gst_event_camera_label_meta_api_get_type() {
  static const GType type = [] {
    static const gchar* tags[] = {"events", nullptr};
    return gst_meta_api_type_register("GstEventCameraLabelMetaAPI", tags);
  }();
  return type;
}

static gboolean init_labels(GstMeta* meta, gpointer, GstBuffer*) {
  auto* labels = reinterpret_cast<GstEventCameraLabelMeta*>(meta);
  labels->labels = nullptr;
  labels->n_labels = 0;
  return TRUE;
}

static void free_labels(GstMeta* meta, GstBuffer*) {
  g_free(reinterpret_cast<GstEventCameraLabelMeta*>(meta)->labels);
}

/// Copies the labels of the events that are copied. A part that cuts an event has none.
static gboolean copy_labels(GstBuffer* copy, GstMeta* meta, GstBuffer*, GQuark type,
                            gpointer data) {
  if (!GST_META_TRANSFORM_IS_COPY(type)) return FALSE;
  const auto* labels = reinterpret_cast<const GstEventCameraLabelMeta*>(meta);
  const auto* part = static_cast<const GstMetaTransformCopy*>(data);
  gsize first = 0;
  gsize count = labels->n_labels;
  if (part->region) {
    constexpr gsize event_size = sizeof(GstEventCameraEvent);
    if (part->offset % event_size != 0 || part->size % event_size != 0) return TRUE;
    first = part->offset / event_size;
    if (first > count) return TRUE;
    count = MIN(count - first, part->size / event_size);
  }
  return gst_buffer_add_event_camera_label_meta(copy, labels->labels + first, count) != nullptr;
}

const GstMetaInfo* gst_event_camera_label_meta_get_info() {
  static const GstMetaInfo* const info =
      gst_meta_register(GST_EVENT_CAMERA_LABEL_META_API_TYPE, "GstEventCameraLabelMeta",
                        sizeof(GstEventCameraLabelMeta), init_labels, free_labels, copy_labels);
  return info;
}

GstEventCameraLabelMeta* gst_buffer_add_event_camera_label_meta(GstBuffer* buffer,
                                                                const GstEventCameraLabel* labels,
                                                                gsize n_labels) {
  g_return_val_if_fail(GST_IS_BUFFER(buffer), nullptr);
  g_return_val_if_fail(gst_buffer_is_writable(buffer), nullptr);

  GstEventCameraLabel* added = nullptr;
  if (n_labels > 0) {
    added = g_try_new0(GstEventCameraLabel, n_labels);
    if (added == nullptr) return nullptr;
    if (labels != nullptr) std::copy_n(labels, n_labels, added);
  }
  auto* meta = reinterpret_cast<GstEventCameraLabelMeta*>(
      gst_buffer_add_meta(buffer, GST_EVENT_CAMERA_LABEL_META_INFO, nullptr));
  meta->labels = added;
  meta->n_labels = n_labels;
  return meta;
}

GstEventCameraLabelMeta* gst_buffer_add_event_camera_label_bytes(GstBuffer* buffer, GBytes* bytes) {
  g_return_val_if_fail(bytes != nullptr, nullptr);
  gsize size = 0;
  const auto* labels = static_cast<const GstEventCameraLabel*>(g_bytes_get_data(bytes, &size));
  return gst_buffer_add_event_camera_label_meta(buffer, labels, size / sizeof(GstEventCameraLabel));
}

GstEventCameraLabelMeta* gst_buffer_get_event_camera_label_meta(GstBuffer* buffer) {
  g_return_val_if_fail(GST_IS_BUFFER(buffer), nullptr);

  auto* meta = reinterpret_cast<GstEventCameraLabelMeta*>(
      gst_buffer_get_meta(buffer, GST_EVENT_CAMERA_LABEL_META_API_TYPE));
  const bool is_complete =
      meta != nullptr &&
      gst_buffer_get_size(buffer) / sizeof(GstEventCameraEvent) == meta->n_labels;
  return is_complete ? meta : nullptr;
}

void gst_event_camera_label_meta_truncate(GstEventCameraLabelMeta* meta, gsize n_labels) {
  g_return_if_fail(meta != nullptr);
  g_return_if_fail(n_labels <= meta->n_labels);
  meta->n_labels = n_labels;
}

GBytes* gst_event_camera_label_meta_get_bytes(const GstEventCameraLabelMeta* meta) {
  g_return_val_if_fail(meta != nullptr, nullptr);
  return g_bytes_new(meta->labels, meta->n_labels * sizeof(GstEventCameraLabel));
}

GType gst_event_camera_flow_meta_api_get_type() {
  static const GType type = [] {
    static const gchar* tags[] = {GST_META_TAG_VIDEO_STR, GST_META_TAG_VIDEO_SIZE_STR,
                                  GST_META_TAG_VIDEO_ORIENTATION_STR, nullptr};
    return gst_meta_api_type_register("GstEventCameraFlowMetaAPI", tags);
  }();
  return type;
}

static gboolean init_flow(GstMeta* meta, gpointer, GstBuffer*) {
  auto* flow = reinterpret_cast<GstEventCameraFlowMeta*>(meta);
  flow->width = 0;
  flow->height = 0;
  flow->flow = nullptr;
  return TRUE;
}

static void free_flow(GstMeta* meta, GstBuffer*) {
  g_bytes_unref(reinterpret_cast<GstEventCameraFlowMeta*>(meta)->flow);
}

/// True if a transformation of a frame leaves each pixel in its place.
static bool keeps_pixels(GQuark type, gpointer data) {
  if (GST_META_TRANSFORM_IS_COPY(type))
    return static_cast<const GstMetaTransformCopy*>(data)->region == FALSE;
  if (!GST_VIDEO_META_TRANSFORM_IS_SCALE(type)) return false;
  // Converters of formats report themselves as scaling to the same size.
  const auto* scale = static_cast<const GstVideoMetaTransform*>(data);
  return GST_VIDEO_INFO_WIDTH(scale->in_info) == GST_VIDEO_INFO_WIDTH(scale->out_info) &&
         GST_VIDEO_INFO_HEIGHT(scale->in_info) == GST_VIDEO_INFO_HEIGHT(scale->out_info);
}

static gboolean copy_flow(GstBuffer* copy, GstMeta* meta, GstBuffer*, GQuark type, gpointer data) {
  if (!keeps_pixels(type, data)) return FALSE;
  const auto* flow = reinterpret_cast<const GstEventCameraFlowMeta*>(meta);
  return gst_buffer_add_event_camera_flow_meta(copy, flow->width, flow->height, flow->flow) !=
         nullptr;
}

const GstMetaInfo* gst_event_camera_flow_meta_get_info() {
  static const GstMetaInfo* const info =
      gst_meta_register(GST_EVENT_CAMERA_FLOW_META_API_TYPE, "GstEventCameraFlowMeta",
                        sizeof(GstEventCameraFlowMeta), init_flow, free_flow, copy_flow);
  return info;
}

/// Bytes whose address is aligned for numbers of this type: `bytes` themselves if they are.
template <class Number>
static GBytes* aligned(GBytes* bytes) {
  gsize size = 0;
  gconstpointer const data = g_bytes_get_data(bytes, &size);
  return GPOINTER_TO_SIZE(data) % alignof(Number) == 0 ? g_bytes_ref(bytes)
                                                       : g_bytes_new(data, size);
}

GstEventCameraFlowMeta* gst_buffer_add_event_camera_flow_meta(GstBuffer* buffer, guint width,
                                                              guint height, GBytes* flow) {
  g_return_val_if_fail(GST_IS_BUFFER(buffer), nullptr);
  g_return_val_if_fail(gst_buffer_is_writable(buffer), nullptr);
  g_return_val_if_fail(width > 0 && width <= GST_EVENT_CAMERA_MAX_SIDE, nullptr);
  g_return_val_if_fail(height > 0 && height <= GST_EVENT_CAMERA_MAX_SIDE, nullptr);
  g_return_val_if_fail(flow != nullptr, nullptr);
  g_return_val_if_fail(g_bytes_get_size(flow) == gsize{width} * height * 2 * sizeof(gfloat),
                       nullptr);

  auto* meta = gst_buffer_get_event_camera_flow_meta(buffer);
  GBytes* const added = aligned<gfloat>(flow);
  if (meta != nullptr)
    g_bytes_unref(meta->flow);
  else
    meta = reinterpret_cast<GstEventCameraFlowMeta*>(
        gst_buffer_add_meta(buffer, GST_EVENT_CAMERA_FLOW_META_INFO, nullptr));
  meta->width = width;
  meta->height = height;
  meta->flow = added;
  return meta;
}

GstEventCameraFlowMeta* gst_buffer_get_event_camera_flow_meta(GstBuffer* buffer) {
  g_return_val_if_fail(GST_IS_BUFFER(buffer), nullptr);
  return reinterpret_cast<GstEventCameraFlowMeta*>(
      gst_buffer_get_meta(buffer, GST_EVENT_CAMERA_FLOW_META_API_TYPE));
}

GBytes* gst_event_camera_flow_meta_get_flow(const GstEventCameraFlowMeta* meta) {
  g_return_val_if_fail(meta != nullptr, nullptr);
  return meta->flow;
}

/* triggers and IMU samples: docs/formats.md describes the events that carry them */

static const char* const triggers_name = "GstEventCameraTriggers";
static const char* const imu_samples_name = "GstEventCameraImu";
static const char* const records_field = "records";

static GstEvent* new_event(const char* name, GBytes* records) {
  return gst_event_new_custom(
      GST_EVENT_CUSTOM_DOWNSTREAM,
      gst_structure_new(name, records_field, G_TYPE_BYTES, records, nullptr));
}

/// The records of an event of this name, without a partial one at the end.
template <class Record>
static GBytes* records_of(GstEvent* event, const char* name) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_DOWNSTREAM || !gst_event_has_name(event, name))
    return nullptr;
  const GValue* value = gst_structure_get_value(gst_event_get_structure(event), records_field);
  if (value == nullptr || !G_VALUE_HOLDS(value, G_TYPE_BYTES) ||
      g_value_get_boxed(value) == nullptr)
    return g_bytes_new(nullptr, 0);
  auto* const bytes = static_cast<GBytes*>(g_value_get_boxed(value));
  const gsize size = g_bytes_get_size(bytes);
  GBytes* const whole = g_bytes_new_from_bytes(bytes, 0, size - size % sizeof(Record));
  GBytes* const records = aligned<Record>(whole);
  g_bytes_unref(whole);
  return records;
}

GstEvent* gst_event_new_event_camera_triggers(GBytes* triggers) {
  g_return_val_if_fail(triggers != nullptr, nullptr);
  g_return_val_if_fail(g_bytes_get_size(triggers) % sizeof(GstEventCameraTrigger) == 0, nullptr);
  return new_event(triggers_name, triggers);
}

GBytes* gst_event_get_event_camera_triggers(GstEvent* event) {
  g_return_val_if_fail(GST_IS_EVENT(event), nullptr);
  return records_of<GstEventCameraTrigger>(event, triggers_name);
}

GstEvent* gst_event_new_event_camera_imu_samples(GBytes* samples) {
  g_return_val_if_fail(samples != nullptr, nullptr);
  g_return_val_if_fail(g_bytes_get_size(samples) % sizeof(GstEventCameraImuSample) == 0, nullptr);
  return new_event(imu_samples_name, samples);
}

GBytes* gst_event_get_event_camera_imu_samples(GstEvent* event) {
  g_return_val_if_fail(GST_IS_EVENT(event), nullptr);
  return records_of<GstEventCameraImuSample>(event, imu_samples_name);
}

/// Writes an event as two words of 8 bytes: bits 32 to 62 of an event are x and y, bit 63 is the
/// polarity.
static void unpack(const GstEventCameraEvent& event, gint64 start,
                   GstEventCameraAbsoluteEvent& out) {
  guint64 bits = 0;
  std::memcpy(&bits, &event, sizeof bits);
  const guint64 place_and_polarity = (bits >> 32 & 0x7fffffffU) | bits >> 63 << 32;
  out.t = start + event.t;
  std::memcpy(reinterpret_cast<std::byte*>(&out) + offsetof(GstEventCameraAbsoluteEvent, x),
              &place_and_polarity, sizeof place_and_polarity);
}

GBytes* gst_event_camera_unpack(GstBuffer* buffer) {
  g_return_val_if_fail(GST_IS_BUFFER(buffer), nullptr);

  GstEventCameraMap map;
  if (!gst_event_camera_map(&map, buffer)) return nullptr;
  auto* const out = g_try_new(GstEventCameraAbsoluteEvent, map.n_events);
  if (out == nullptr && map.n_events > 0) {
    gst_event_camera_unmap(&map);
    return nullptr;
  }
  for (gsize i = 0; i < map.n_events; ++i)
    unpack(map.events[i], static_cast<gint64>(map.start), out[i]);
  GBytes* const bytes = g_bytes_new_take(out, map.n_events * sizeof *out);
  gst_event_camera_unmap(&map);
  return bytes;
}

/// Times beyond this, in either direction, are errors: 142 years.
static constexpr gint64 max_time = gint64{1} << 52;

/// Converts to the core's events. False if one is outside the sensor or earlier than the last one.
static bool convert_events(std::span<const GstEventCameraAbsoluteEvent> events, guint width,
                           guint height, std::vector<eventcamera::AbsoluteEvent>& out) {
  out.reserve(events.size());
  gint64 last = -max_time;
  for (const auto& event : events) {
    if (event.x >= width || event.y >= height || event.t < last || event.t > max_time) return false;
    last = event.t;
    out.emplace_back(event.t, event.x, static_cast<guint16>(event.y | (event.p != 0 ? 0x8000 : 0)));
  }
  return true;
}

gboolean gst_event_camera_voxel_grid(const GstEventCameraAbsoluteEvent* events, gsize n_events,
                                     guint width, guint height, guint bins, gfloat* grid) {
  g_return_val_if_fail(width > 0 && width <= GST_EVENT_CAMERA_MAX_SIDE, FALSE);
  g_return_val_if_fail(height > 0 && height <= GST_EVENT_CAMERA_MAX_SIDE, FALSE);
  g_return_val_if_fail(bins > 0 && bins <= GST_EVENT_CAMERA_MAX_BINS, FALSE);

  try {
    std::vector<eventcamera::AbsoluteEvent> sorted;
    if (!convert_events({events, n_events}, width, height, sorted)) return FALSE;
    eventcamera::EventTensor(static_cast<int>(width), static_cast<int>(height),
                             {.bins = static_cast<int>(bins)})
        .write(sorted, 0, reinterpret_cast<std::byte*>(grid));
    return TRUE;
  } catch (const std::exception& error) {
    g_warning("%s", error.what());
    return FALSE;
  }
}
