// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/tensor/tensor_format.hpp"

#include "features.hpp"
#ifdef HAVE_TENSOR_META
#include <gst/analytics/analytics.h>

#endif

using namespace eventcamera;

/// Framerate of the tensors: 0/1 if it varies or is not a fraction of integers.
std::pair<gint, gint> TensorFormat::framerate() const {
  gint n = 0;
  gint d = 1;
  if (windows.events > 0) return {n, d};
  const auto hop = windows.duration > 0 ? windows.hop(windows.duration)
                                        : static_cast<Nanoseconds>(windows.hop(windows.intervals));
  if (hop > G_MAXINT) return {n, d};
  const gboolean fits = windows.duration > 0
                            ? gst_util_fraction_multiply(static_cast<gint>(GST_SECOND), 1, 1,
                                                         static_cast<gint>(hop), &n, &d)
                            : gst_util_fraction_multiply(sensor.fps_n, sensor.fps_d, 1,
                                                         static_cast<gint>(hop), &n, &d);
  return fits ? std::pair(n, d) : std::pair(0, 1);
}

GstClockTime TensorFormat::latency() const {
  if (windows.events > 0) return 0;
  if (windows.duration > 0) return static_cast<GstClockTime>(windows.duration);
  if (sensor.fps_n <= 0) return 0;
  return gst_util_uint64_scale((windows.intervals - 1) * GST_SECOND,
                               static_cast<guint64>(sensor.fps_d),
                               static_cast<guint64>(sensor.fps_n));
}

OwnedCaps TensorFormat::caps() const {
  const auto of = shape();
  const auto dimensions = std::to_string(of.width) + ":" + std::to_string(of.height) + ":" +
                          std::to_string(of.channels) + ":1";
  const auto [fps_n, fps_d] = framerate();
  const auto* const type =
      g_enum_get_value(static_cast<GEnumClass*>(g_type_class_peek(tensor_data_type())),
                       static_cast<gint>(tensors.type));
  return OwnedCaps(gst_caps_new_simple("other/tensors", "format", G_TYPE_STRING, "static",
                                       "num_tensors", G_TYPE_INT, 1, "dimensions", G_TYPE_STRING,
                                       dimensions.c_str(), "types", G_TYPE_STRING, type->value_nick,
                                       "framerate", GST_TYPE_FRACTION, fps_n, fps_d, nullptr));
}

/// Caps fields, and the properties that determine them.
static constexpr std::pair<const char*, const char*> advice[] = {
    {"types", "set data-type"},
    {"dimensions", "set representation or bins, or scale the events"},
    {"framerate", "set accumulation-time, frame-count or overlap"}};

std::string mismatch_text(GstCaps* wanted, GstCaps* made) {
  std::string wishes;
  if (gst_caps_get_size(wanted) == 0) return wishes;
  for (const auto& [field, remedy] : advice) {
    const auto* value = gst_structure_get_value(gst_caps_get_structure(wanted, 0), field);
    if (value == nullptr ||
        gst_value_intersect(nullptr, value,
                            gst_structure_get_value(gst_caps_get_structure(made, 0), field)))
      continue;
    gchar* const text = gst_value_serialize(value);
    wishes +=
        (wishes.empty() ? ": " : ", ") + (std::string(field) + "=") + text + " (" + remedy + ")";
    g_free(text);
  }
  return wishes;
}

#ifdef HAVE_TENSOR_META

static GstTensorDataType data_type_of(ElementType type) {
  switch (type) {
    case ElementType::float32:
      return GST_TENSOR_DATA_TYPE_FLOAT32;
    case ElementType::float16:
      return GST_TENSOR_DATA_TYPE_FLOAT16;
    case ElementType::uint8:
      break;
  }
  return GST_TENSOR_DATA_TYPE_UINT8;
}

/// Returns a buffer of the same memory, because a meta that refers to its own buffer is never
/// freed.
static GstBuffer* same_memory(GstBuffer* buffer) {
  GstBuffer* const same = gst_buffer_new();
  for (guint i = 0; i < gst_buffer_n_memory(buffer); ++i)
    gst_buffer_append_memory(same, gst_buffer_get_memory(buffer, i));
  return same;
}

void add_tensor_meta(GstBuffer* buffer, const TensorShape& shape, const TensorSettings& settings) {
  static const GQuark id = g_quark_from_static_string("event-tensor");
  std::array<gsize, 4> dimensions = {1, static_cast<gsize>(shape.channels),
                                     static_cast<gsize>(shape.height),
                                     static_cast<gsize>(shape.width)};
  auto** const tensors = g_new(GstTensor*, 1);
  tensors[0] =
      gst_tensor_new_simple(id, data_type_of(settings.type), same_memory(buffer),
                            GST_TENSOR_DIM_ORDER_ROW_MAJOR, dimensions.size(), dimensions.data());
  gst_tensor_meta_set(gst_buffer_add_tensor_meta(buffer), 1, tensors);
}

#else

void add_tensor_meta(GstBuffer*, const TensorShape&, const TensorSettings&) {}

#endif
