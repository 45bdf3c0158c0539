// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/picture_formats.hpp"

eventcamera::LumaFormat luma_format_of(const GstVideoInfo& info) {
  // P010 and its kin have their bits at the top of the word, so white is as in 16 bits.
  const auto bits =
      GST_VIDEO_INFO_COMP_DEPTH(&info, 0) + GST_VIDEO_FORMAT_INFO_SHIFT(info.finfo, 0);
  return {GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info), static_cast<int>(bits)};
}

bool has_packed_luma(const GstVideoInfo& info) {
  return GST_VIDEO_INFO_COMP_DEPTH(&info, 0) == 8 && GST_VIDEO_INFO_COMP_PSTRIDE(&info, 0) == 2;
}
