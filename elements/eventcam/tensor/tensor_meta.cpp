// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/tensor/tensor_meta.hpp"

#include "features.hpp"
#ifdef HAVE_TENSOR_META

#include <gst/analytics/analytics.h>

#include <array>

using eventcamera::ElementType;

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

/// A buffer of the same memory: a meta that refers to its own buffer would never be freed.
static GstBuffer* same_memory(GstBuffer* buffer) {
  GstBuffer* const same = gst_buffer_new();
  for (guint i = 0; i < gst_buffer_n_memory(buffer); ++i)
    gst_buffer_append_memory(same, gst_buffer_get_memory(buffer, i));
  return same;
}

void add_tensor_meta(GstBuffer* buffer, const eventcamera::TensorShape& shape,
                     const eventcamera::TensorSettings& settings) {
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

void add_tensor_meta(GstBuffer*, const eventcamera::TensorShape&,
                     const eventcamera::TensorSettings&) {}

#endif
