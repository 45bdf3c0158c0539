// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/stream_header.hpp"

OwnedCaps with_stream_header(OwnedCaps caps, GstBuffer* header) {
  GST_BUFFER_FLAG_SET(header, GST_BUFFER_FLAG_HEADER);
  GValue buffer = G_VALUE_INIT;
  g_value_init(&buffer, GST_TYPE_BUFFER);
  gst_value_set_buffer(&buffer, header);
  GValue headers = G_VALUE_INIT;
  g_value_init(&headers, GST_TYPE_ARRAY);
  gst_value_array_append_and_take_value(&headers, &buffer);
  GstCaps* const extended = gst_caps_make_writable(caps.release());
  gst_structure_take_value(gst_caps_get_structure(extended, 0), "streamheader", &headers);
  return OwnedCaps(extended);
}
